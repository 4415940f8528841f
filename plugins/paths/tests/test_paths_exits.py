"""Ways in and out of a dent in a wall at the end of a long fork."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_nozzle
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Floats, Solid
from damageest.geometry.transforms import turn_to_axis
from tests.path_shapes import Loss, cut, plan

INWARD = (1.0, 0.0, 0.0)


def make_fork(with_lids: bool = False) -> Loss:
    """A fork 300 long and 30 high, dented in the inside of its left wall; with lids, a box with a window opposite the
    dent."""
    fork = Manifold.cube((300, 100, 30), True) - Manifold.cube((300, 70, 100), True).translate((20, 0, 0))
    if with_lids:
        fork = Manifold.cube((300, 140, 140), True) - Manifold.cube((280, 120, 120), True)
        fork -= Manifold.cube((60, 100, 100), True).translate((150, 0, 0))
    x = -140 if with_lids else -130
    return cut(fork, Manifold.sphere(9, 48).translate((x + 6, 0, 0)))


@cache
def plan_fork(axes: int, with_lids: bool = False) -> tuple[Loss, DepositPath]:
    loss = make_fork(with_lids)
    return loss, plan(loss, axes=axes, direction=INWARD)


def put_nozzle(path: DepositPath, k: int, further: float = 0.0) -> Floats:
    """The corners (N,3) of the nozzle at a move, or so much further along its axis."""
    tip = path.points[k] + (path.standoff + further) * path.axes[k]
    return np.asarray(path.nozzle.vertices @ turn_to_axis(path.axes[k]).T + tip)


def is_beside(corners: Floats, part: Solid) -> bool:
    """Whether a plane along an edge of the part's box parts the corners (N,3) from it."""
    low, high = part.bounds
    return bool((corners.min(axis=0) > high).any() or (corners.max(axis=0) < low).any())


@pytest.mark.slow
def test_with_5_axes_the_tool_leaves_a_fork_sideways() -> None:
    loss, path = plan_fork(5)
    _, straight = plan_fork(3)
    assert path.travel < 0.5 * straight.travel
    for k in (0, -1):
        for further in (0.0, 50.0):  # a program comes in from there
            assert is_beside(put_nozzle(path, k, further), loss.left)
    assert measure_nozzle(path, loss.left, 0.1) >= 0.75 * min(path.clearance, path.travel_clearance) > 0


def test_with_3_axes_the_tool_comes_from_above() -> None:
    loss, path = plan_fork(3)
    for k in (0, -1):
        assert path.points[k][0] + path.standoff > loss.left.bounds[1][0]


@pytest.mark.slow
def test_where_the_sides_are_shut_the_tool_leaves_along_its_axis() -> None:
    loss, path = plan_fork(5, with_lids=True)
    assert path.travel_clearance > 0
    for k in (0, -1):
        assert put_nozzle(path, k)[:, 0].min() > loss.left.bounds[1][0]
    assert measure_nozzle(path, loss.left, 0.1) > 0


@pytest.mark.slow
def test_the_check_would_see_a_way_through_the_wall() -> None:
    loss, path = plan_fork(5)
    points = path.points.copy()
    points[0, 1] = points[1, 1] + 200
    points[0, 2] = points[1, 2]
    assert measure_nozzle(replace(path, points=points), loss.left, 0.1) == pytest.approx(0)
