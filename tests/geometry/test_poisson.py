"""The Poisson field: through the points, up along the normals, and around a known volume."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Floats
from damageest.geometry.isosurface import extract_region
from damageest.geometry.poisson import (
    Grid,
    GridValues,
    make_grid,
    refine_field,
    solve_coarse_to_fine,
    solve_poisson,
)
from tests.geometry.shapes import FAR

RADIUS = 5.0


def measure_nodes(grid: Grid) -> Floats:
    axes = (grid.origin[k] + grid.cell * np.arange(n) for k, n in enumerate(grid.shape))
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)


def sample_ball(subdivisions: int, away: Floats) -> tuple[Floats, Floats, Floats]:
    """Points of a sphere, normals inward, and the area of each point."""
    ball = trimesh.creation.icosphere(subdivisions, RADIUS)
    count = len(ball.vertices)
    return ball.vertices + away, -ball.vertices / RADIUS, np.full(count, 4 * np.pi * RADIUS**2 / count)


def interpolate(grid: Grid, field: GridValues, points: Floats) -> Floats:
    nodes, weights = grid.find_corners(points)
    return np.asarray((field.ravel()[nodes] * weights).sum(axis=1))


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
def test_points_of_a_sphere_give_its_volume(away: Floats) -> None:
    points, normals, areas = sample_ball(4, away)
    grid = make_grid(away - 7, away + 7, 0.4)
    field = solve_poisson(grid, points, normals, areas, 4.0)
    assert np.abs(interpolate(grid, field, points)).max() < 0.1
    # it rises by about 1 from outside to the centre
    outside, centre = interpolate(grid, field, away + np.array([[0, 0, 6.8], [0, 0, 0]]))
    assert centre - outside == pytest.approx(1, abs=0.15)
    solid = extract_region(grid, field)
    assert solid is not None
    assert solid.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.02)


def test_the_coarse_start_gives_the_same_surface() -> None:
    points, normals, areas = sample_ball(5, np.zeros(3))
    grid = make_grid(np.full(3, -6.5), np.full(3, 6.5), 0.19)
    assert grid.size > 300_000
    solid = extract_region(grid, solve_coarse_to_fine(grid, points, normals, areas, 4.0))
    assert solid is not None
    assert solid.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)


@given(st.integers(0, 1000), st.floats(0.05, 3))
@settings(max_examples=25, deadline=None)
def test_a_grid_holds_its_box_and_interpolates_linear_fields(seed: int, cell: float) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(-50, 50, 3)
    high = low + cell * rng.uniform(0.5, 20, 3)
    grid = make_grid(low, high, cell)
    points = rng.uniform(low, high, (50, 3))
    assert grid.contains(np.stack([low, high])).all()
    assert grid.contains(points).all()
    assert not grid.contains(points + 2 * cell * np.array(grid.shape)).any()
    slope, offset = rng.normal(size=3), rng.normal()
    nodes, weights = grid.find_corners(points)
    values = (measure_nodes(grid) @ slope + offset).ravel()
    assert weights.sum(axis=1) == pytest.approx(1)
    assert (values[nodes] * weights).sum(axis=1) == pytest.approx(points @ slope + offset)


def test_the_finer_field_is_the_coarse_one_between_its_nodes() -> None:
    grid = Grid(np.array([1.0, 2, 3]), 0.5, (16, 20, 24))
    half = grid.coarsen()
    assert half.shape == (8, 10, 12)
    assert half.origin == pytest.approx([1.25, 2.25, 3.25])
    slope = np.array([0.3, -0.2, 0.1])
    fine = refine_field((measure_nodes(half) @ slope).astype(np.float32))
    inner = (slice(1, -1),) * 3  # the sides have no node beyond them
    assert fine.shape == grid.shape
    assert fine[inner] == pytest.approx((measure_nodes(grid) @ slope)[inner], abs=1e-5)
