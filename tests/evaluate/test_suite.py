from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.evaluate import suite
from damageest.evaluate._case import Case, cases, scanned


def a_row(case: Case, **figures: Any) -> dict[str, Any]:
    row = {"key": case.key(), "part": case.part, "seed": case.seed, "kinds": ["pit"], "share": 0.1, "error": ""}
    return row | {"iou": 0.99, "flagged": False, "sites": 1, "seconds": 2.0} | figures


def test_a_case_repeats_and_its_noise_is_known() -> None:
    case = Case(0, "cuboid", 5, points=3000)
    (part, a, kinds), (_, b, _) = scanned(case), scanned(case)
    assert a.points.tobytes() == b.points.tobytes()
    assert kinds
    assert part.volume == pytest.approx(105_000)
    assert a.truth is not None
    assert not np.allclose(a.truth.T_part_scan, np.eye(4))


def test_an_undamaged_case_has_no_damage() -> None:
    truth = scanned(Case(0, "cuboid", 5, points=1000, undamaged=True))[1].truth
    assert truth is not None
    assert truth.damage is None


def test_rows_on_file_are_not_run_again_and_new_ones_are_appended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wanted = cases(3, 0, ["cuboid", "block"], "random", "auto", False, 1000, "4")
    out = tmp_path / "rows.jsonl"
    out.write_text(json.dumps(a_row(wanted[1])) + '\n{"key": "cut sh')
    ran: list[str] = []

    def apart(case: Case, timeout: float) -> dict[str, Any]:
        ran.append(case.key())
        return a_row(case, volume_error=0.01)

    monkeypatch.setattr(suite, "_apart", apart)
    rows = suite.run_all(wanted, out, 1, 10)
    assert ran == [wanted[0].key(), wanted[2].key()]
    assert [row["key"] for row in rows] == [case.key() for case in wanted]
    suite.run_all(wanted, out, 1, 10)
    assert len(ran) == 2
    assert "+0.0100" in capsys.readouterr().out


def test_a_case_that_takes_too_long_is_a_row_with_an_error() -> None:
    row = suite._apart(Case(0, "cuboid", 5), timeout=0.01)
    assert "not done" in row["error"]
    assert row["iou"] == 0
    assert not row["flagged"]


def test_the_summary_counts_right_wrong_and_flagged() -> None:
    case = Case(0, "cuboid", 5)
    figures: list[dict[str, Any]] = [{}, {"flagged": True}, {"iou": 0.92}, {"iou": 0.3}, {"iou": 0.2, "flagged": True}]
    text = suite.summary([a_row(case, **f) for f in figures])
    assert "5 cases: IoU >= 0.95: 2 (40%), median 0.9200, worst 0.200; 0 without a result" in text
    assert "wrong (IoU < 0.9): 2, flagged 1 of them" in text
    assert "falsely flagged: 1 of 3 with IoU >= 0.9, 1 of 2 with IoU >= 0.95" in text
    assert suite.summary([a_row(case, sites=0), a_row(case)], undamaged=True).startswith("2 undamaged: 1 without")
