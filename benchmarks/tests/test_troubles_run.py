"""Cases from the trouble to the row, and the command line."""

from __future__ import annotations

from pathlib import Path

import pytest
from damageest_benchmarks.troubles.case import run_case
from damageest_benchmarks.troubles.suite import make_trouble_cases
from damageest_evaluate.rows import read_rows
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import InputError
from tests.evaluate_calls import evaluate


@pytest.mark.slow
def test_a_run_is_judged_and_measured() -> None:
    (case,) = make_trouble_cases(["undamaged part, full"], ["block"], points=4000)
    row = run_case(case)
    assert row["outcome"] == "right"
    assert row["true_volume"] == row["found_volume"] == 0
    assert 0 < row["step_seconds"] < row["cpu_seconds"]
    assert row["key"] == case.compute_key()


def test_a_scan_in_another_unit_is_refused_and_said() -> None:
    case = next(case for case in make_trouble_cases(["wrong unit"], points=2000) if case.pose == "unknown")
    row = run_case(case)
    assert (row["outcome"], row["refused"]) == ("said", True)
    assert "unit" in row["error"]


def test_the_command_lists_cases_and_names_what_is_unknown() -> None:
    done = CliRunner().invoke(app, ["evaluate", "honesty", "--kinds", "lost wall", "--list"])
    assert done.exit_code == 0
    assert "lost wall: wall_plate, known pose, 8 positions, not given, amount 4" in done.stdout
    done = CliRunner().invoke(app, ["evaluate", "honesty", "--seeds", "one"])
    assert isinstance(done.exception, InputError)
    assert "--seeds: 'one' is not valid" in str(done.exception)


@pytest.mark.slow
def test_the_command_resumes_and_has_exit_status_0(tmp_path: Path) -> None:
    words = ("honesty", "--kinds", "lost wall", "--case", "12", "--points", "3000", "--out", tmp_path)
    first = evaluate(*words)
    assert first.returncode == 0, first.stderr
    rows = read_rows(tmp_path / "honesty.jsonl")
    assert len(rows) == 1
    again = evaluate(*words)
    assert again.returncode == 0
    assert read_rows(tmp_path / "honesty.jsonl") == rows
    assert "| lost wall | 1 |" in (tmp_path / "honesty.md").read_text()
