"""Steady tool axes along a pass, what the machine reaches, and rings of a smooth border."""

from __future__ import annotations

import numpy as np
from damageest_paths.clearance.axes import turn_upright
from damageest_paths.fill.regions import drop_narrow, make_region, smooth_border
from damageest_paths.fill.stripes import Bead
from damageest_paths.fill.weave import Style, weave_piece
from damageest_paths.holding.reach import is_reached, keep_reached, turn_reach
from damageest_paths.holding.steady import steady_axes
from damageest_paths.process.frames import make_frame

from damageest.geometry.vectors import normalise
from tests.path_shapes import plan, slot

HALF = np.array([0.0, 0.0, 1.0, 0.0, 1.0])
"""A machine that reaches all axes that do not point down."""


def test_axes_of_a_rough_floor_are_steadied() -> None:
    angle = np.linspace(-1.0, 1.0, 400)
    points = 20 * np.stack([np.sin(angle), np.cos(angle), np.zeros(400)], axis=1)
    rough = normalise(points + np.random.default_rng(0).normal(0, 3.0, points.shape))
    rate = np.radians(20.0) / 2.0
    steady = steady_axes(points, rough, rate, 2.0)
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert (np.linalg.norm(np.diff(rough, axis=0), axis=1) > rate * length).any()
    assert (np.linalg.norm(np.diff(steady, axis=0), axis=1) <= rate * length).all()
    assert np.degrees(np.arccos(np.einsum("ni,ni->n", steady, points / 20).clip(-1, 1))).max() < 25


def test_axes_beyond_the_machine_go_to_the_nearest_that_it_reaches() -> None:
    axes = normalise(np.array([[1.0, 0.0, -0.1], [0.3, 0.4, 0.5], [0.0, 1.0, 0.0]]))
    kept = keep_reached(axes, HALF)
    assert is_reached(axes, HALF).tolist() == [False, True, True]
    assert is_reached(kept, HALF).all()
    assert np.allclose(kept[0], [1, 0, 0], atol=1e-6)
    assert np.array_equal(kept[1:], axes[1:])
    assert keep_reached(axes, None) is axes
    frame = make_frame(np.array([1.0, 0.0, 0.0]), np.zeros(3))
    turned = turn_reach(HALF, frame)
    assert is_reached(axes @ frame.turn.T, turned).tolist() == [False, True, True]


def test_corners_of_a_smooth_border_do_not_multiply_from_ring_to_ring() -> None:
    angle = np.linspace(0, 2 * np.pi, 700, endpoint=False)
    wavy = 24 + 0.3 * np.sin(31 * angle)
    region = make_region([np.stack([wavy * np.cos(angle), 0.5 * wavy * np.sin(angle)], axis=1)])
    lines = weave_piece(region, "spiral", Bead(2.0, 1.4), 0.0, Style(), None)
    assert sum(len(line.points) for line in lines) < 3000


def test_even_borders_keep_nearly_all_of_a_region() -> None:
    square = make_region([np.array([[0.0, 0], [20, 0], [20, 10], [0, 10]])])
    spike = make_region([np.array([[20.0, 5], [24, 5], [24, 5.3], [20, 5.3]])])
    even = smooth_border(square + spike, 2.0)
    assert abs(even.area() - 200) < 1.0
    assert even.bounds()[2] < 20.5
    assert drop_narrow(square + spike, 1.0).bounds()[2] < 20.5


def test_what_is_not_filled_is_one_note_that_says_where() -> None:
    path = plan(slot(), axes=3, height=4.0, width=6.0, standoff=6.0, simulate=False)
    told = [note for note in path.notes if "is not filled" in note]
    assert path.unreached_volume > 0
    assert len(told) == 1
    assert ", the largest piece at (" in told[0]
    assert all(item.why in told[0] for item in path.unreached if item.volume > 1e-3 * path.deposit_volume)


def test_passes_are_tilted_by_no_more_than_it_takes() -> None:
    axes = np.array([[0.0, 0.0, 1.0], [np.sin(0.8), 0.0, np.cos(0.8)]])
    half = turn_upright(axes, 0.5)
    assert np.allclose(half, [[0, 0, 1], [np.sin(0.4), 0, np.cos(0.4)]])
