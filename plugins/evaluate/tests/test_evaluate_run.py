"""Rows are kept in a file, and runs resume from it; no case is run."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from damageest_evaluate import processes
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

    def run(module: str, inputs: dict[str, Any], timeout: float) -> dict[str, Any]:
        case = DamageCase(**inputs)
        keys.append(case.compute_key())
        return case.make_blank_row() | {"seconds": timeout}

    monkeypatch.setattr(rows_module, "run_in_process", run)
    return keys


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


def test_a_process_that_crashes_says_so() -> None:
    message = processes.run_in_process("damageest_evaluate.case", {"part": "cuboid"}, 60)
    assert isinstance(message, str)
    assert message.startswith("the process crashed with exit status 1: TypeError")
