"""Patches of points: on two sides of a wall, of several views, and means over them."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry.patches import Patches

POINTS = np.array([[0.1, 0.1, 0.1], [0.2, 0.1, 0.1], [0.3, 0.2, 0.1], [1.4, 0.1, 0.1]])
UP = np.array([0.0, 0.0, 1.0])


def test_points_of_a_cube_on_two_sides_of_a_wall_are_two_patches() -> None:
    assert Patches.in_cubes(POINTS, 1.0).count.tolist() == [3, 1]
    on_skin = Patches.on_skin(POINTS, np.array([UP, UP, -UP, UP]), 1.0)
    assert sorted(on_skin.count.tolist()) == [1, 1, 2]
    assert on_skin.group[0] == on_skin.group[1] != on_skin.group[2]


def test_a_mean_is_that_of_the_points_of_a_patch() -> None:
    patches = Patches.of_equal(np.array([7, 3, 7, 7]))
    assert patches.count.tolist() == [1, 3]
    assert patches.first.tolist() == [1, 0]
    assert patches.mean(np.array([1.0, 5.0, 2.0, 6.0])).tolist() == [5.0, 3.0]
    assert patches.mean(POINTS)[1] == pytest.approx(POINTS[[0, 2, 3]].mean(axis=0))


def test_views_split_a_patch() -> None:
    patches = Patches.in_cubes(POINTS, 1.0)
    of_views = patches.split(np.array([0, 2, 0, 2]))
    assert of_views.count.tolist() == [2, 1, 1]
    assert patches.group[of_views.first].tolist() == [0, 0, 1]


def test_no_points_are_in_no_patch() -> None:
    none = Patches.on_skin(np.empty((0, 3)), np.empty((0, 3)), 1.0)
    assert none.mean(np.empty((0, 3))).shape == (0, 3)
    assert none.split(np.empty(0, np.int64)).mean(np.empty(0)).shape == (0,)
