"""Cubes of a voxel grid against counting by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.geometry.voxels import VoxelGrid, measure_area, number_cubes, number_faced_cubes, order_by_place
from tests.geometry.shapes import FAR


@given(st.integers(0, 10_000), st.sampled_from([0.0, 1e5]))
@settings(max_examples=50, deadline=None)
def test_numbers_are_those_of_an_array_of_cubes(seed: int, away: float) -> None:
    rng = np.random.default_rng(seed)
    shape = rng.integers(1, 9, 3)
    grid = VoxelGrid(rng.uniform(-5, 5, 3) + away, float(rng.uniform(0.1, 3)), shape)
    cube = rng.integers(0, shape, (40, 3))
    points = grid.low + grid.size * (cube + rng.uniform(0.001, 0.999, (40, 3)))
    assert np.array_equal(grid.number_cells(points), np.ravel_multi_index(tuple(cube.T), tuple(shape)))
    # outside the grid it is the nearest cube of the outermost layer
    off = rng.integers(-9, 18, (40, 3))
    points = grid.low + grid.size * (off + rng.uniform(0.001, 0.999, (40, 3)))
    nearest = np.clip(off, 0, shape - 1)
    assert np.array_equal(grid.number_cells(points), np.ravel_multi_index(tuple(nearest.T), tuple(shape)))


@given(st.integers(0, 10_000), st.integers(0, 2))
@settings(max_examples=30, deadline=None)
def test_marked_cubes_are_those_within_the_layers(seed: int, layers: int) -> None:
    rng = np.random.default_rng(seed)
    shape = rng.integers(2 * layers + 1, 2 * layers + 8, 3)
    grid = VoxelGrid(np.zeros(3), 0.5, shape)
    held = rng.integers(layers, shape - layers, (3, 3))
    every = np.stack(np.unravel_index(np.arange(shape.prod()), tuple(shape)), axis=1)
    steps = np.abs(every[:, None] - held).max(axis=2).min(axis=1)
    assert np.array_equal(grid.mark_around(0.5 * (held + 0.5), layers), steps <= layers)


@given(st.integers(0, 10_000), st.floats(0.05, 5))
@settings(max_examples=50, deadline=None)
def test_points_have_one_number_exactly_where_they_share_a_cube(seed: int, edge: float) -> None:
    points = np.random.default_rng(seed).normal(size=(60, 3))
    cell, number = number_cubes(points, edge)
    low = points.min(axis=0)
    assert np.array_equal(cell, np.floor((points - low) / edge))
    same = (cell[:, None] == cell).all(axis=2)
    assert np.array_equal(number[:, None] == number, same)
    order = np.argsort(number, kind="stable")
    assert np.array_equal(order, np.lexsort(cell.T[::-1]))  # along z first, then y, then x
    from_below, _ = number_cubes(points, edge, low - 2 * edge)
    assert np.abs(from_below - cell - 2).max() <= 1


def test_cubes_are_the_same_far_from_the_origin() -> None:
    points = np.random.default_rng(0).integers(0, 50, (200, 3)) * 0.25 + 0.125
    cell, number = number_cubes(points, 0.5, np.zeros(3))
    far_cell, far_number = number_cubes(points + FAR, 0.5, FAR)
    assert np.array_equal(cell, far_cell)
    assert np.array_equal(number, far_number)


def test_faced_cubes_tell_the_six_directions_apart() -> None:
    normals = np.concatenate([np.eye(3), -np.eye(3), [[0.1, -0.2, 0.9]]])
    points = np.repeat([[0.1, 0.2, 0.3], [5.0, 5, 5]], 7, axis=0)
    cell, number = number_faced_cubes(points, np.tile(normals, (2, 1)), 1.0)
    assert np.array_equal(cell, number_cubes(points, 1.0)[0])
    assert len(set(number.tolist())) == 12
    assert number[2] == number[6] != number[9] == number[13]


@given(st.integers(0, 10_000), st.integers(1, 4))
@settings(max_examples=30, deadline=None)
def test_area_is_that_of_cubes_with_enough_points(seed: int, fewest: int) -> None:
    rng = np.random.default_rng(seed)
    cubes = rng.permutation(np.stack(np.unravel_index(np.arange(125), (5, 5, 5)), axis=1))[:6]
    count = rng.integers(1, 6, len(cubes))
    points = 0.5 * (np.repeat(cubes, count, axis=0) + rng.uniform(0.1, 0.9, (count.sum(), 3)))
    points = np.vstack([points, np.full(3, 0.001), np.full(3, 2.499)])  # so that cubes begin at the origin
    count = np.concatenate([count, [1, 1]])
    every = np.vstack([cubes, [0, 0, 0], [4, 4, 4]])
    number = np.bincount(np.ravel_multi_index(tuple(every.T), (5, 5, 5)), weights=count)
    assert np.isclose(measure_area(points, 0.5, fewest), 0.25 * (number >= fewest).sum())


@pytest.mark.parametrize("count", [1, 3000])
def test_points_in_order_of_place_lie_near_the_one_before(count: int) -> None:
    points = 40.0 + 7 * np.random.default_rng(3).random((count, 3))
    order = order_by_place(points)
    assert np.array_equal(np.sort(order), np.arange(count))
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert np.linalg.norm(np.diff(points[order], axis=0), axis=1).sum() <= 0.6 * steps
