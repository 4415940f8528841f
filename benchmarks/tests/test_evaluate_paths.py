"""The checks of paths see what they are for, and the planner's paths pass them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from damageest_benchmarks.paths.beam import count_flips, measure_shaded, measure_sunk
from damageest_benchmarks.paths.check import count_crossings, measure_nozzle
from damageest_benchmarks.paths.run import evaluate_scene, make_table
from damageest_benchmarks.paths.scenes import MAKERS, make_random

from damageest.artefacts import DepositPath
from tests.path_shapes import Loss, dent, plan


@cache
def plan_dent() -> tuple[Loss, DepositPath]:
    loss = dent()
    return loss, plan(loss, direction=(0.0, 0.0, 1.0), simulate=False)


@pytest.mark.slow
def test_a_tooth_is_built_up_with_five_axes_and_nothing_is_touched() -> None:
    (scene, *_) = MAKERS["tooth"](np.random.default_rng(3), "tooth")
    row, plain = evaluate_scene(scene, 5), evaluate_scene(scene, 3)
    assert row.filled > 0.99
    assert row.unreached <= plain.unreached
    assert row.gap >= 0.75 * row.claimed > 0
    assert row.crossings == 0
    assert row.spill <= 1.1
    assert row.shaded == 0
    assert row.sunk <= 0.06
    assert row.flips == 0
    assert "| tooth | 5 | 1 |" in make_table([row, plain])


@pytest.mark.slow
def test_the_check_sees_a_nozzle_in_metal() -> None:
    loss, path = plan_dent()
    assert measure_nozzle(path, loss.left, 0.2) >= 0.75 * min(path.clearance, path.travel_clearance)
    lower = replace(path, points=path.points - [0, 0, path.standoff + path.width])
    assert measure_nozzle(lower, loss.left, 5.0) == pytest.approx(0, abs=1e-9)


@pytest.mark.slow
def test_the_check_sees_beads_and_beam_in_metal() -> None:
    loss, path = plan_dent()
    assert measure_shaded(path, loss.left, path.width / 4) == 0
    assert measure_sunk(path, loss.left, path.width / 4) <= 0.05 * loss.lost.volume
    lower = replace(path, points=path.points - [0, 0, 6.0])  # the dent is 4 deep
    # of beads of the layer's height: those over air are higher
    assert 0.9 * lower.bead_volume < measure_sunk(lower, loss.left, path.width / 4) <= 1.02 * lower.bead_volume
    assert measure_shaded(lower, loss.left, path.width / 4) > 0.9
    aside = np.array([0.96, 0.0, 0.28])  # the beam through the wall of the dent, the beads where they were
    tilted = replace(path, axes=np.tile(aside, (len(path.axes), 1)))
    assert measure_shaded(tilted, loss.left, path.width / 4) > 0.05


@pytest.mark.slow
def test_the_check_sees_a_rotary_axis_that_flips() -> None:
    _, path = plan_dent()
    assert count_flips(path) == 0
    axes = path.axes.copy()
    axes[:] = [0.6, 0.0, 0.8]
    axes[np.flatnonzero(path.on)[5] :] = [-0.6, 0.0, 0.8]
    assert count_flips(replace(path, axes=axes)) == 1
    upright = np.where(axes[:, :1] > 0, [0.05, 0.0, -0.99875], [-0.05, 0.0, -0.99875])  # from below, nearly along z
    assert count_flips(replace(path, axes=upright / np.linalg.norm(upright, axis=1)[:, None])) == 0


def test_the_check_sees_a_pass_that_crosses_itself() -> None:
    _, path = plan_dent()
    assert count_crossings(path) == 0
    points = path.points.copy()
    own = np.flatnonzero(path.on & (path.number == np.argmax(np.bincount(path.number[path.on]))))
    middle = (points[own[0] - 1] + points[own[0]]) / 2
    points[own[-1]] = 2 * middle - points[own[-1] - 1]  # the last move passes through the middle of the first
    assert count_crossings(replace(path, points=points)) > 0


@pytest.mark.slow
def test_random_deposits_are_the_same_twice() -> None:
    first, second = make_random(3)[0], make_random(3)[0]
    assert first.body.vertices.tobytes() == second.body.vertices.tobytes()
    assert first.name == second.name
