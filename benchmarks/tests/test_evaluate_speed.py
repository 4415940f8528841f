"""`damageest evaluate speed`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from damageest_benchmarks.readme import make_marks
from damageest_benchmarks.speed import KINDS, make_speed_cases
from damageest_benchmarks.whole import LARGE, OWN, Run, make_whole_table, run_program
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import DamageestError, InputError
from damageest.registry import Registry
from tests.evaluate_calls import evaluate


@pytest.mark.slow
def test_a_case_is_measured_against_one_distance_pass(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    begin, end = make_marks("speed")
    page.write_text(f"{begin}\n{end}\n")
    done = evaluate("speed", "--kinds", "small scan", "--points", "2e4", "--set", "report=none", "--write", page)
    assert done.returncode == 0, done.stderr
    (line,) = [text for text in page.read_text().splitlines() if text.startswith("| small scan")]
    _, points, iou, _, processor, _, libigl, a_million, ratio, *_ = (
        word.strip() for word in line.strip("|").split("|")
    )
    assert points == "20000"
    assert float(iou) > 0.8
    assert float(a_million) == pytest.approx(50 * float(libigl), rel=0.3)
    assert float(ratio) == pytest.approx(float(processor) / float(libigl), rel=0.3)
    assert "enclose" in line
    assert "`damageest evaluate speed" in page.read_text()


@pytest.mark.parametrize(("words", "said"), [(["--kinds", "small chap"], "small chip"), (["--points", "many"], "1e6")])
def test_a_wrong_value_is_refused(words: list[str], said: str) -> None:
    with pytest.raises(DamageestError) as caught:
        CliRunner().invoke(app, ["evaluate", "speed", *words], catch_exceptions=False)
    assert caught.value.exit_status == 2
    assert said in str(caught.value)


@pytest.mark.slow
def test_cases_have_the_damage_of_their_kind(registry: Registry) -> None:
    cases = make_speed_cases(list(KINDS), 0, [], registry)
    assert [len(case.tools) for case in cases] == [len(kind.tools) for kind in KINDS.values()]
    assert len({case.compute_key() for case in cases}) == len(KINDS)
    with pytest.raises(InputError, match="no 'chip'"):
        make_speed_cases(["chip"], 0, [], registry)


def test_options_of_one_way_are_refused_in_the_other() -> None:
    for words in (["--whole", "--points", "2e4"], ["--program", "damageest"], ["--whole", "--kinds", "bloc"]):
        with pytest.raises(InputError) as caught:
            CliRunner().invoke(app, ["evaluate", "speed", *words], catch_exceptions=False)
        assert "--program" in str(caught.value) or "'block'" in str(caught.value)


def test_the_least_of_each_case_and_the_median_of_the_common_ones_are_shown() -> None:
    runs = [Run("block", "new", seconds, 2.0, 10.0, ("likely", "proven", "likely")) for seconds in (8.0, 6.0, 7.0)]
    runs += [Run("gear", "new", 10.0, 2.0, 3.0, ()), Run(LARGE, "new", 40.0, 2.0, 5.0, ())]
    lines = [[word.strip() for word in line.strip("|").split("|")] for line in make_whole_table(runs).splitlines()]
    assert ["block", "3.0", "6.0", "10.00", "2 likely, 1 proven"] in lines
    assert [LARGE, "20.0", "40.0", "5.00", ""] in lines
    assert lines[-1][:2] == ["median of the common runs", "4.0"]


def test_a_run_beyond_its_time_is_a_row_and_no_end(tmp_path: Path) -> None:
    program = tmp_path / "damageest"
    program.write_text("#!/bin/sh\nexec sleep 60\n")
    program.chmod(0o755)
    seconds = run_program(str(program), tmp_path / "job.yaml", tmp_path / "out", 0.1)
    assert seconds == float("inf")
    rows = make_whole_table([Run("block", "new", seconds, 2.0, float("nan"), ())])
    assert "| block | inf |" in rows


@pytest.mark.slow
@pytest.mark.nightly
def test_whole_runs_by_two_programs_agree() -> None:
    done = evaluate("speed", "--whole", "--kinds", "lever", "--program", OWN, "--program", OWN, "--json")
    assert done.returncode == 0, done.stderr
    one, other = json.loads(done.stdout)["rows"]
    assert one["volume"] == other["volume"] > 0
    assert one["verdicts"] == other["verdicts"]
    assert min(one["seconds"], other["seconds"]) > one["libigl_seconds"] > 0
