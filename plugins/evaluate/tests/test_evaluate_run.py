"""Rows are kept in a file, and runs resume from it; no case is run."""

from __future__ import annotations

import json
import math
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from damageest_evaluate import rows as rows_module
from damageest_evaluate.case import DamageCase

CASES = [
    DamageCase("cuboid", seed, "pit", 0.2, scanner={"noise": noise, "points": 10}, varied={"noise": noise})
    for seed in (0, 1)
    for noise in (0.1, 0.2)
]


@pytest.fixture
def ran(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The keys of the cases that were run, in place of running them."""
    keys: list[str] = []

    def run(function: Any, arguments: dict[str, Any], timeout: float) -> dict[str, Any]:
        case: DamageCase = arguments["case"]
        keys.append(case.compute_key())
        return case.make_blank_row() | {"seconds": timeout}

    monkeypatch.setattr(rows_module, "run_in_process", run)
    return keys


@pytest.mark.slow
def test_rows_on_file_are_not_run_again_and_new_ones_are_appended(tmp_path: Path, ran: list[str]) -> None:
    out = tmp_path / "cases.jsonl"
    told: list[dict[str, Any]] = []
    out.write_text(json.dumps(CASES[1].make_blank_row() | {"iou": 0.5}) + '\n{"key": "cut sh')
    rows = rows_module.run_all(CASES, out, 2, 10, told.append)
    assert sorted(ran) == sorted(CASES[k].compute_key() for k in (0, 2, 3))
    assert [row["key"] for row in rows] == [case.compute_key() for case in CASES]
    assert [row["iou"] for row in rows] == [0, 0.5, 0, 0]
    assert len(told) == 4
    assert rows_module.run_all(CASES, out, 2, 99, told.append) == rows
    assert len(ran) == 3
    assert len(out.read_text().splitlines()) == 4


def test_what_a_row_stands_for_is_up_to_the_run(tmp_path: Path, ran: list[str]) -> None:
    out = tmp_path / "cases.jsonl"
    rows_module.run_all(CASES[:1], out, 1, 10, lambda row: None)
    same = [replace(CASES[0], varied={"size": "any"}), replace(CASES[0], varied={"size": "all"})]
    rows = rows_module.run_all(same, out, 1, 10, lambda row: None)
    assert [row["varied"] for row in rows] == [{"size": "any"}, {"size": "all"}]
    assert len(ran) == 1


@dataclass(frozen=True)
class OddCase(DamageCase):
    """A case that does not give a row."""

    def run(self) -> dict[str, Any]:
        if self.first == "aborts":
            os.abort()
        if self.first == "hangs":
            time.sleep(60)
        if self.first == "raises":
            raise TypeError("no such part")
        return {**self.make_blank_row(), "kinds": (1, 2), "volume": math.nan}


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("what", "error"),
    [
        ("aborts", "its process ended by an abort (SIGABRT)"),
        ("hangs", "was ended: not finished after 0.5 s, the time limit of a case"),
        ("raises", "the process raised TypeError: no such part"),
    ],
)
def test_a_case_without_a_row_says_why(what: str, error: str) -> None:
    row = rows_module.run_one(OddCase("cuboid", 0, what, 0.2, scanner=CASES[0].scanner), 0.5 if what == "hangs" else 60)
    assert row["error"] == error
    assert row["part"] == "cuboid"


@pytest.mark.slow
def test_a_row_is_as_a_file_holds_it() -> None:
    row = rows_module.run_one(OddCase("cuboid", 0, "", 0.2, scanner=CASES[0].scanner), 60)
    assert row["kinds"] == [1, 2]
    assert math.isnan(row["volume"])
