"""`damageest evaluate realistic`: the cases, their scans, the counts, and the command line."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.commands._counted import parse_numbers
from damageest_benchmarks.realistic import case as realistic_case
from damageest_benchmarks.realistic.case import make_loss, make_part, make_scanner, place_sensor, run_case
from damageest_benchmarks.realistic.report import find_faults, make_realistic_report, make_realistic_table
from damageest_benchmarks.realistic.sensors import SENSORS
from damageest_benchmarks.realistic.suite import PARTS, make_realistic_cases
from damageest_evaluate.scores import measure_depth
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import InputError, StageError
from damageest.geometry.distance import signed_distance
from tests.evaluate_calls import evaluate


def test_the_suite_has_every_sensor_on_every_part() -> None:
    cases = make_realistic_cases()
    assert len(cases) >= 60
    assert len({(case.sensor, case.part) for case in cases}) == len(SENSORS) * len(PARTS)
    assert len(SENSORS) == 6
    assert len(PARTS) == 10
    assert sum(case.damaged for case in cases) == len(cases) / 2
    views = {case.views for case in cases}
    assert {1, 2, 3, 4, 6, 8, 12} <= views
    for name, sensor in SENSORS.items():
        met = Counter((case.views, case.damaged) for case in cases if case.sensor == name)
        assert set(met) == {(count, damaged) for count in sensor.views for damaged in (True, False)}
    assert [case.number for case in cases] == list(range(1, len(cases) + 1))


def test_cases_are_chosen_by_name_number_and_share() -> None:
    assert {case.sensor for case in make_realistic_cases(["stereo"])} == {"stereo camera"}
    assert [case.number for case in make_realistic_cases(numbers=[7, 12])] == [7, 12]
    assert [case.number for case in make_realistic_cases(every=20)] == [1, 21, 41]
    with pytest.raises(InputError, match="tomography"):
        make_realistic_cases(["radar"])
    with pytest.raises(InputError, match="--case"):
        make_realistic_cases(numbers=[0])
    with pytest.raises(InputError, match="whole numbers"):
        parse_numbers("--case", "one")


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", list(SENSORS))
def test_a_scan_deviates_by_the_resolution_of_its_sensor(name: str) -> None:
    """Without a loss: the median deviation, which outliers do not change, is that of the noise that is stated."""
    case = next(case for case in make_realistic_cases([name], points=6000) if not case.damaged and case.views != 1)
    part = make_part(case)
    scan = make_scanner(case, (), place_sensor(case, part) if case.views else None).run(part.unit, part)
    assert scan.viewpoints is None
    assert scan.truth is not None
    off = signed_distance(scan.move(scan.truth.T_part_scan).points, part)[0]
    spread = 1.4826 * np.median(np.abs(off)) / SENSORS[name].resolution
    assert 0.4 < spread < 1.5
    again = make_scanner(case, (), place_sensor(case, part) if case.views else None).run(part.unit, part)
    assert np.array_equal(scan.points, again.points)


@pytest.mark.parametrize("number", [11, 33, 51])
def test_a_loss_is_far_deeper_than_the_noise_and_small(number: int) -> None:
    (case,) = make_realistic_cases(numbers=[number], points=3000)
    part = make_part(case)
    scanners = place_sensor(case, part) if case.views else None
    scan = make_scanner(case, make_loss(case, part, scanners), scanners).run(part.unit, part)
    assert scan.truth is not None
    assert scan.truth.damage is not None
    assert measure_depth(scan.truth.damage, part) > 8 * SENSORS[case.sensor].resolution
    assert scan.truth.damage.volume < 0.1 * part.volume


@pytest.mark.slow
def test_a_run_is_judged_and_its_cost_compared() -> None:
    (case,) = make_realistic_cases(["tomography"], ["cylinder"], points=4000)
    assert not case.damaged
    row = run_case(case)
    assert row["key"] == case.compute_key()
    assert row["outcome"] in ("right", "said")
    assert row["pose_error"] < 5 * row["resolution"]
    assert row["clean_seconds"] > 0
    assert row["true"] == 0
    assert isinstance(row["notes"], list)


def test_a_refusal_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise StageError("the scan is too sparse")

    monkeypatch.setattr(realistic_case, "run_job", refuse)
    (case,) = make_realistic_cases(["tomography"], ["block"], points=3000)
    row = run_case(case)
    assert (row["outcome"], row["refused"], row["pose_error"]) == ("said", True, None)
    assert row["true"] > 0
    assert "1 | 0 | 0 of 0" in make_realistic_table([row])


def make_row(**values: Any) -> dict[str, Any]:
    case = make_realistic_cases(["tomography"], ["blade"])[0]
    good = {"outcome": "right", "pose_error": 0.5 * case.make_blank_row()["resolution"], "tolerance": 0.1}
    return case.make_blank_row() | good | {"seconds": 3.0, "cpu_seconds": 3.0, "clean_seconds": 2.0} | values


def test_the_table_counts_what_is_wanted() -> None:
    group = {"truth": 2.0, "volume": 2.0, "low": 1.0, "high": None, "levels": ["likely"], "accepted": 1}
    rows = [
        make_row(),
        make_row(damaged=True, sites=1, accepted=1, groups=[group]),
        make_row(sites=2, accepted=1, outcome="silent", notes=["note"] * 9, cpu_seconds=8.0),
        make_row(skipped=True),
    ]
    line = make_realistic_table(rows).splitlines()[-1]
    assert line == "| all | 3 | 2 | 0 | 0 | 0 | 1 | 1 of 1 | 0.50 | 3 of 3 | 2 | 1 | 1 | 0 | 9 | 1.5 | 4.0 |"
    assert [find_faults(row) for row in rows[:2]] == [[], []]
    faults = find_faults(rows[2])
    assert [text.split()[0] for text in faults] == ["silent", "2", "9", "4.0"]
    assert "--case 52" in make_realistic_report(rows, "damageest evaluate realistic")
    assert "steps" in find_faults(make_row(pose_error=1.0))[0]


def test_the_command_lists_cases_and_names_what_is_unknown() -> None:
    done = CliRunner().invoke(app, ["evaluate", "realistic", "--parts", "gear", "--list"])
    assert done.exit_code == 0
    assert "24 time of flight: gear, 1 view, a loss" in done.stdout
    assert isinstance(CliRunner().invoke(app, ["evaluate", "realistic", "--parts", "gaer"]).exception, InputError)


@pytest.mark.slow
def test_a_case_is_run_once_and_the_table_written(tmp_path: Path) -> None:
    text = tmp_path / "text.md"
    text.write_text("<!-- realistic: begin -->\n<!-- realistic: end -->\n")
    words = ["realistic", "--case", "60", "--points", "5000", "--out", tmp_path, "--write", text]
    first, second = (evaluate(*words) for _ in range(2))
    assert first.returncode == second.returncode == 0, first.stderr
    assert first.stdout == second.stdout
    assert len((tmp_path / "realistic.jsonl").read_text().splitlines()) == 1
    assert "| tomography | 1 |" in text.read_text()
