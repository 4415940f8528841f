"""What beads fill with the widths and heights that trials give them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import BeadFill, DepositPath
from tests.path_shapes import dent, plan

TRIALS: list[dict[str, Any]] = [
    {"set": {"speed": 300.0}, "width": 2.3, "height": 1.3},
    {"set": {"speed": 600.0}, "width": 2.0, "height": 1.0},
    {"set": {"speed": 1200.0}, "width": 1.2, "height": 0.6},
]


@cache
def plan_dent(speed: float | None = None, simulate: bool = True) -> DepositPath:
    """A dent in layers of 1 with beads of 2, at 600 or with another speed set for the passes."""
    options: dict[str, Any] = {} if speed is None else {"calibration": TRIALS, "process": [{"set": {"speed": speed}}]}
    return plan(dent(), direction=(0.0, 0.0, 1.0), width=2.0, height=1.0, simulate=simulate, **options)


def get_fill(path: DepositPath) -> BeadFill:
    assert path.fill is not None
    return path.fill


def measure_level(path: DepositPath) -> float:
    """The volume of the beads, were none over air higher than its layer."""
    assert path.bead_sizes is not None
    long = np.linalg.norm(np.diff(path.points, axis=0, prepend=path.points[:1]), axis=1) * path.on
    return float(path.bead_volume * (long @ path.heights[path.part - 1]) / (long @ path.bead_sizes[:, 1]))


@pytest.mark.slow
def test_beads_as_planned_fill_what_is_planned() -> None:
    plain, laid = plan_dent(), plan_dent(600.0)
    # layers are made equal, so that they are a little lower than 1
    assert get_fill(laid).filled == pytest.approx(get_fill(plain).filled, abs=0.01)
    assert laid.bead_volume == pytest.approx(measure_level(plain) / plain.heights[0], rel=1e-6)


@pytest.mark.slow
def test_small_beads_leave_gaps() -> None:
    plain, laid = plan_dent(), plan_dent(1200.0)
    assert get_fill(plain).filled > 0.99
    # rows are 1.4 apart and layers 1 high, or little less
    assert get_fill(laid).of_deposit == pytest.approx(1.2 * 0.6 / (1.4 * plain.heights[0]), abs=0.08)
    assert laid.bead_volume == pytest.approx(measure_level(plain) * 0.36 / plain.heights[0], rel=1e-6)
    assert laid.surplus_volume == 0


@pytest.mark.slow
def test_large_beads_stand_out_and_a_note_says_so() -> None:
    plain, laid = plan_dent(), plan_dent(300.0)
    assert get_fill(laid).spill > 1.3 * get_fill(plain).spill
    assert get_fill(laid).sunk > get_fill(plain).sunk
    assert laid.surplus_volume > 0.4 * laid.deposit_volume
    assert [note for note in laid.notes if "mill it off" in note and f"add {laid.surplus_volume:.4g}" in note]
    assert sum("mill it off" in note for note in laid.notes) == 1


def test_what_is_not_simulated_stays_so() -> None:
    assert plan_dent(300.0, simulate=False).fill is None
