"""The tool axis turns along a pass where no one tilt is free all along."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_nozzle
from damageest_paths.clearance.axes import list_axes
from damageest_paths.clearance.turning import BLOCKED, divide_turns, plan_course, turn_evenly
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Floats
from damageest.geometry.vectors import normalise
from tests.path_shapes import Loss, cut, plan

AXES = list_axes(np.radians(60))
LINE = np.column_stack([np.linspace(0, 20, 81), np.zeros(81), np.zeros(81)])
RATE = np.radians(10.0)


def measure_turns(axes: Floats) -> Floats:
    return np.asarray(np.arccos(np.clip((axes[1:] * axes[:-1]).sum(axis=1), -1, 1)))


def test_an_axis_that_is_free_all_along_is_kept() -> None:
    course = plan_course(LINE, AXES, np.zeros((81, len(AXES))), RATE)
    assert course.joined.all()
    assert measure_turns(course.axes).max() == 0


def test_the_axis_turns_no_faster_than_it_may() -> None:
    costs = np.zeros((81, len(AXES)))
    costs[50:, 0] = costs[:30, 1] = BLOCKED  # upright to begin with, tilted at the end
    costs[:, 2:] = BLOCKED
    course = plan_course(LINE, AXES, costs, RATE)
    assert course.joined.all()
    assert np.allclose(course.axes[:30], AXES[0])
    assert np.allclose(course.axes[50:], AXES[1])
    turns = measure_turns(course.axes)
    assert abs(np.degrees(turns.sum()) - 20) < 1e-6
    assert turns.max() <= RATE * 0.25 + 1e-9


def test_where_there_is_no_room_to_turn_the_pass_is_cut() -> None:
    costs = np.zeros((81, len(AXES)))
    costs[40:, 0] = costs[:40, 1] = BLOCKED
    costs[:, 2:] = BLOCKED
    course = plan_course(LINE, AXES, costs, RATE)
    assert np.flatnonzero(~course.joined).tolist() == [39]
    still = plan_course(LINE, AXES, costs, 0.0)
    assert np.flatnonzero(~still.joined).tolist() == [39]


def test_a_turn_is_even() -> None:
    turns = measure_turns(turn_evenly(AXES[0], AXES[9], np.linspace(0, 1, 11)))
    assert np.allclose(turns, turns[0])


def make_passage() -> Loss:
    """A long groove with a wall on one side of its first part, and one on the other side of its last part."""
    block = Manifold.cube((80, 30, 20)).translate((-40, -15, -20))
    walls = Manifold.cube((20, 4, 30)).translate((-40, 3.0, 0)) + Manifold.cube((20, 4, 30)).translate((20, -7.0, 0))
    return cut(block + walls, Manifold.cube((80, 3, 1.6)).translate((-40, -1.5, -1.6)))


def plan_passage(turn: float) -> DepositPath:
    fat = {"tip_radius": 1.0, "cone_angle": 25.0, "length": 60.0, "body_radius": 9.0}
    return plan(make_passage(), direction=(0, 0, 1), axes=5, nozzle=fat, machine={"turn": turn}, turn=0.0)


@pytest.mark.slow
def test_turning_saves_cuts_and_touches_nothing() -> None:
    turning, still = plan_passage(20.0), plan_passage(0.0)
    assert turning.unreached_volume <= still.unreached_volume + 1e-9
    assert turning.passes < still.passes
    assert turning.travel < 1.1 * still.travel  # mostly the ways in and out: between passes the tool stays down
    on = np.flatnonzero(turning.on)
    rate = measure_turns(turning.axes)[on - 1] / np.maximum(turning.moves[on], 1e-9)
    assert 0 < np.degrees(rate.max()) <= 20.0 / turning.width * 1.001
    least = min(turning.clearance, turning.travel_clearance)
    assert measure_nozzle(turning, make_passage().left, 0.1) >= 0.75 * least > 0


@given(st.integers(0, 10**6), st.integers(2, 12))
@settings(max_examples=60, deadline=None)
def test_the_axis_about_z_turns_by_little_between_poses(seed: int, count: int) -> None:
    """Also where the tool passes z, upward or downward; the pass itself stays the same."""
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(count, 3)), axis=0)
    axes = normalise(np.array([0, 0, rng.choice([-1.0, 1.0])]) + rng.normal(0, 0.15, (count, 3)))
    normals = normalise(np.array([0.0, 0, 1]) + rng.normal(0, 0.1, (count, 3)))
    more, turned, up = divide_turns(points, axes, normals)
    lying = np.hypot(turned[:, 0], turned[:, 1])
    turn = np.degrees(np.arctan2(turned[:, 1], turned[:, 0]))
    step = np.abs((np.diff(turn) + 180) % 360 - 180)
    assert (step[np.minimum(lying[1:], lying[:-1]) > np.sin(np.radians(5))] <= 45).all()
    for rows in (turned, up):
        assert np.allclose(np.linalg.norm(rows, axis=1), 1)
    old = [int(np.flatnonzero((more == point).all(axis=1))[0]) for point in points]
    assert np.array_equal(turned[old], axes)
    assert np.array_equal(up[old], normals)
    assert np.linalg.norm(np.diff(more, axis=0), axis=1).sum() == pytest.approx(
        np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    )
    assert measure_turns(turned).sum() == pytest.approx(measure_turns(axes).sum())
