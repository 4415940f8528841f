"""The tool axis turns along a pass where no one tilt is free all along."""

from __future__ import annotations

import numpy as np
from damageest_evaluate.paths.check import measure_nozzle
from damageest_paths.axes import list_axes
from damageest_paths.turning import BLOCKED, plan_course, turn_evenly
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Floats
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
