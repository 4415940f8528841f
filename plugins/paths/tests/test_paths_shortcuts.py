"""Corners of ways between passes are cut where nothing stands."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.process.process import measure_along
from damageest_paths.tool.nozzle import Cone, make_nozzle
from damageest_paths.travel.network import Way, measure_way
from damageest_paths.travel.shortcuts import cut_corners
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from damageest.artefacts import Mesh
from damageest.geometry.solids import to_arrays
from damageest.geometry.vectors import normalise

GAP = 0.5


def make_clearance(post: float) -> Clearance:
    """A plate with a post, 1.5 in radius and ``post`` high."""
    block = Manifold.cube((80, 40, 10)).translate((-40, -20, -10)) + Manifold.cylinder(post, 1.5)
    obstacles = Obstacles([Mesh(*to_arrays(block))], np.array([-16.0, -4, 0]), np.array([16.0, 4, 0]), 1.0)
    return Clearance(make_nozzle(Cone(1.0, 3.0, 25.0, 0.4)), 3.0, obstacles).during_travel()


@pytest.mark.slow
@given(st.integers(0, 10**6), st.sampled_from([0.5, 12.0, 30.0]))
@settings(max_examples=12, deadline=None)
def test_a_way_gets_shorter_and_stays_clear(seed: int, post: float) -> None:
    """Over places at random high above the plate, and with the tool leaning at random."""
    rng = np.random.default_rng(seed)
    clearance = make_clearance(post)
    inner = rng.uniform([-20, -15, 36], [20, 15, 60], (4, 3))
    first, last = np.array([[-12.0, -3, 1], [-12, -3, 36]]), np.array([[12.0, 3, 36], [12, 3, 1]])
    points = np.vstack([first, inner, last])
    axes = normalise(np.column_stack([rng.uniform(-0.4, 0.4, (8, 2)), np.ones(8)]))
    axes[:2] = axes[-2:] = [0, 0, 1]
    way = Way(points, axes, measure_way(points, axes, clearance, GAP))
    assert way.gap >= GAP / 2
    short = cut_corners(way, clearance, GAP)
    assert np.array_equal(short.points[[0, -1]], points[[0, -1]])
    assert np.allclose(short.axes[[0, -1]], axes[[0, -1]])
    assert measure_along(short.points)[-1] <= 0.9 * measure_along(points)[-1]
    share = np.linspace(0, 1, 80)[:, None]
    for k in range(len(short.points) - 1):
        places = short.points[k] + share * (short.points[k + 1] - short.points[k])
        turned = normalise(short.axes[k] + share * (short.axes[k + 1] - short.axes[k]))
        assert min(clearance.measure(*pose) for pose in zip(places, turned, strict=True)) >= GAP / 2 - 1e-9


def test_a_turn_on_the_spot_stays_where_only_there_is_room() -> None:
    """Between two walls: the tool comes in lying along them, and turns upright above them."""
    walls = Manifold.cube((10, 30, 20)).translate((1.8, -15, 0)) + Manifold.cube((10, 30, 20)).translate(
        (-11.8, -15, 0)
    )
    obstacles = Obstacles([Mesh(*to_arrays(walls))], np.array([-2.0, -15, 0]), np.array([2.0, 15, 20]), 1.0)
    clearance = Clearance(make_nozzle(Cone(1.0, 1.0, 25.0, 0.4)), 3.0, obstacles).during_travel()
    points = np.array([[0.0, -8, 5], [0, -8, 40], [0, -8, 40], [0, 8, 40], [0, 8, 40], [0, 8, 5]])
    lying, upright = normalise(np.array([[0.0, -0.6, 1.0], [0.4, 0.6, 1.0]]))
    axes = np.array([lying, lying, upright, upright, lying, lying])
    way = Way(points, axes, measure_way(points, axes, clearance, GAP))
    assert way.gap >= GAP / 2
    short = cut_corners(way, clearance, GAP)
    assert measure_way(short.points, short.axes, clearance, GAP) >= GAP / 2
    assert measure_along(short.points)[-1] < 0.5 * measure_along(points)[-1]
    assert np.allclose(short.axes[[0, -1]], axes[[0, -1]])


def test_a_straight_way_stays_as_it_is() -> None:
    clearance = make_clearance(30.0)
    points = np.array([[-12.0, -10, 1], [12.0, -10, 1]])
    way = Way(points, np.tile([0.0, 0, 1], (2, 1)), GAP)
    assert np.array_equal(cut_corners(way, clearance, GAP).points, points)
