"""`damageest evaluate suite --intervals`: its cases, its rows and its table."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from damageest_benchmarks.intervals import (
    NOISES,
    POINTS,
    format_interval_row,
    make_interval_cases,
    make_interval_tables,
    run_interval_case,
)
from damageest_benchmarks.parts import PARTS
from damageest_evaluate.damages import KINDS
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import InputError
from damageest.registry import Registry


def row(inside: bool = True, noise: float = 0.001, known: bool = True, **more: Any) -> dict[str, Any]:
    interval = (98.0, 102.0) if inside else (90.0, 94.0)
    values = {"part": "block", "seed": 1, "kinds": ["pit"], "true_volume": 100.0, "volume": 99.0, "true_depth": 5.0}
    values |= {"volume_95": interval, "depth_95": (4.9, 5.1), "doubtful": 0, "sites": 1, "error": "", "skipped": False}
    varied = {"noise": noise, "points": 30_000, "pose": "known" if known else "unknown"}
    return values | {"seconds": 2.0, "varied": varied, **more}


def cells(text: str, name: str) -> list[str]:
    line = next(line for line in text.splitlines() if line.startswith(f"| {name} "))
    return [word.strip() for word in line.strip("|").split("|")][1:]


def test_cases_cover_all_levels_parts_and_kinds_alike(registry: Registry) -> None:
    cases = make_interval_cases(72, 3, list(PARTS), registry)
    levels = [(case.varied["noise"], case.varied["points"]) for case in cases]
    assert {level: levels.count(level) for level in levels} == {(n, p): 8 for n in NOISES for p in POINTS}
    assert [case.part for case in cases[:13]] == list(PARTS)
    assert {case.first for case in cases} == set(KINDS)
    assert sum(case.varied["pose"] == "unknown" for case in cases) == 18
    assert len({case.compute_key() for case in cases}) == 72
    assert all(case.tolerance == pytest.approx(4 * case.scanner["noise"]) for case in cases)


def test_table_counts_the_truth_inside_and_the_median_width() -> None:
    rows = [row(), row(), row(inside=False), row(noise=0.0005, known=False, volume_95=None, depth_95=None)]
    text = make_interval_tables([*rows, row(skipped=True)], "damageest evaluate suite --intervals")
    assert cells(text, "all") == ["4", "66.7% ± 27.2%", "2.00%", "100.0% ± 16.7%", "2.00%", "1"]
    assert cells(text, "noise 0.0005 of the diagonal") == ["1", "–", "–", "–", "–", "1"]
    assert cells(text, "pose known")[0] == "3"
    assert "Skipped, since no damage fits the part: 1." in text
    assert "`damageest evaluate suite --intervals`. Measured" in text


def test_line_of_a_case_says_what_is_outside() -> None:
    assert "outside" not in format_interval_row(row())
    assert "volume: truth outside" in format_interval_row(row(inside=False))
    assert "no interval" in format_interval_row(row(volume_95=None))
    assert "too few points" in format_interval_row(row(error="too few points"))


def test_unknown_parts_and_options_that_it_sets_itself_are_refused(registry: Registry) -> None:
    with pytest.raises(InputError, match="did you mean 'cuboid'"):
        make_interval_cases(1, 0, ["cubiod"], registry)
    with pytest.raises(InputError, match="at least 1"):
        make_interval_cases(0, 0, ["cuboid"], registry)
    done = CliRunner().invoke(app, ["evaluate", "suite", "--intervals", "--noise", "2"])
    assert done.exit_code != 0
    assert "leave out" in str(done.exception)


@pytest.mark.slow
def test_a_case_has_an_interval_with_the_truth(registry: Registry) -> None:
    (case,) = make_interval_cases(1, 5, ["cuboid"], registry)
    found = run_interval_case(case)
    assert not found["error"]
    assert found["volume_95"][0] <= found["true_volume"] <= found["volume_95"][1]
    assert found["key"] == case.compute_key()


@pytest.mark.slow
def test_rows_are_kept_and_the_table_goes_to_the_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("<!-- intervals: begin -->\n<!-- intervals: end -->\n")
    words = [
        "evaluate",
        "suite",
        "--intervals",
        "--cases",
        "2",
        "--parts",
        "cuboid",
        "--no-plots",
        "--out",
        str(tmp_path),
    ]
    words += ["--write", str(page), "--marks", "intervals"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert cells(page.read_text(), "all")[0] == "2"
    rows = (tmp_path / "intervals.jsonl").read_text()
    again = CliRunner().invoke(app, [*words, "--json"])
    assert len(json.loads(again.stdout)["rows"]) == len(rows.splitlines())
    assert (tmp_path / "intervals.jsonl").read_text() == rows
