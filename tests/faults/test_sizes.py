"""Whole jobs with few and many points end with a result that is right or doubted, or with a refusal in words."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from damageest.registry import Registry
from tests.faults.sizes import Case, Row, compare_rows, list_cases, list_cheap, read_rows, run_case, write_rows

CHEAP, DEFAULT = list_cheap(), list_cases()
ALL = [*DEFAULT, *(case for case in list_cases(whole=True) if case not in DEFAULT)]


def mark(case: Case) -> tuple[pytest.MarkDecorator, ...]:
    return () if case in CHEAP else (pytest.mark.slow,) if case in DEFAULT else (pytest.mark.nightly,)


ENOUGH = 5000
"""Points from which a pose is found; below it a refusal is right."""


@pytest.mark.variants(slow=10)
@pytest.mark.parametrize("case", [pytest.param(case, id=case.name, marks=mark(case)) for case in ALL])
def test_a_job_of_any_size_is_right_or_doubted_or_refused_in_words(case: Case, registry: Registry) -> None:
    row = run_case(case, registry)
    assert row.outcome in ("right", "inside", "said", "refused"), row
    if row.outcome == "refused":
        assert case.points < ENOUGH, row
        assert "align: register" in row.reason
    elif float(row.volume):  # what is accepted is near the truth, and the interval says how near
        assert float(row.low) <= 1 <= float(row.high), row
        assert 0.8 < float(row.volume) < 1.2, row
    else:  # nothing was found, or it is doubted: no interval claims that nothing was lost
        assert not row.high or float(row.high) > 0.5, row
    if case.points >= 9999 and case.tolerance == 0.5:
        assert row.outcome in ("right", "inside"), row


def test_two_sweeps_are_compared_on_everything_but_the_seconds(tmp_path: Path) -> None:
    first = Row("block 60", "right", "likely", "1.01", "0.9", "1.1", "0.98", "", 2.0)
    second = replace(first, name="block 200")
    write_rows(tmp_path / "rows.csv", [first, second])
    before = read_rows(tmp_path / "rows.csv")
    assert before == [first, second]
    assert compare_rows(before, [replace(first, seconds=1.0), second]) == ["0 of 2 differ; 4.0 s before, 3.0 s now"]
    changed = compare_rows(before, [first, replace(second, outcome="silent", volume="1.3")])
    assert len(changed) == 2
    assert changed[0].startswith("block 200: right likely 1.01")
    assert changed[0].endswith("silent likely 1.3 0.9 1.1 0.98 ")
    assert changed[1].startswith("1 of 2 differ")
