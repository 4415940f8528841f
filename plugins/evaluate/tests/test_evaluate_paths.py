"""The checks of paths see what they are for, and the planner's paths pass them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from damageest_evaluate.paths.check import count_crossings, measure_nozzle
from damageest_evaluate.paths.run import evaluate_scene, make_table
from damageest_evaluate.paths.scenes import MAKERS, make_random

from tests.path_shapes import dent, plan


@pytest.mark.slow
def test_a_tooth_is_built_up_with_five_axes_and_nothing_is_touched() -> None:
    (scene, *_) = MAKERS["tooth"](np.random.default_rng(3), "tooth")
    row = evaluate_scene(scene)
    assert row.filled > 0.99
    assert row.unreached_5 <= row.unreached_3
    assert row.gap >= 0.75 * row.claimed > 0
    assert row.crossings == 0
    assert row.spill <= 1
    assert "| tooth | 1 |" in make_table([row])


def test_the_check_sees_a_nozzle_in_metal() -> None:
    loss = dent()
    path = plan(loss, direction=(0.0, 0.0, 1.0), simulate=False)
    assert measure_nozzle(path, loss.left, 0.2) >= 0.75 * min(path.clearance, path.travel_clearance)
    lower = replace(path, points=path.points - [0, 0, path.standoff + 0.01])
    assert measure_nozzle(lower, loss.left, 5.0) == pytest.approx(0, abs=1e-9)


def test_the_check_sees_a_pass_that_crosses_itself() -> None:
    path = plan(dent(), direction=(0.0, 0.0, 1.0), simulate=False)
    assert count_crossings(path) == 0
    points = path.points.copy()
    own = np.flatnonzero(path.on & (path.number == path.passes))
    points[own[3]] = points[own[0] - 1] - [1, 1, 0]
    assert count_crossings(replace(path, points=points)) > 0


@pytest.mark.slow
def test_random_deposits_are_the_same_twice() -> None:
    first, second = make_random(3)[0], make_random(3)[0]
    assert first.body.vertices.tobytes() == second.body.vertices.tobytes()
    assert first.name == second.name
