"""Solids from fields on a grid."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.geometry.isosurface import extract_region
from damageest.geometry.poisson import Grid
from tests.geometry.shapes import FAR


def measure_nodes(grid: Grid) -> Floats:
    """The nodes' distance from the grid's origin corner, per axis."""
    return np.stack(np.meshgrid(*(grid.cell * np.arange(n) for n in grid.shape), indexing="ij"), axis=-1)


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
@pytest.mark.parametrize("radius", [4.0, 3.77])
def test_a_ball_also_where_nodes_lie_exactly_on_it(radius: float, away: Floats) -> None:
    grid = Grid(away, 0.5, (20, 22, 24))
    field = (radius - np.linalg.norm(measure_nodes(grid) - 5.0, axis=-1)).astype(np.float32)
    solid = extract_region(grid, field)
    assert solid is not None
    assert solid.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02)
    assert np.linalg.norm(solid.cross, axis=1).min() > 1e-12
    assert np.abs(np.linalg.norm(solid.vertices - away - 5, axis=1) - radius).max() < 0.05


def test_a_field_that_is_positive_everywhere_fills_the_grid() -> None:
    grid = Grid(np.zeros(3), 0.5, (20, 16, 12))
    solid = extract_region(grid, np.ones(grid.shape, np.float32))
    assert solid is not None
    assert solid.bounds == pytest.approx(np.array([[-0.25] * 3, [9.75, 7.75, 5.75]]))


def test_nothing_positive_is_nothing() -> None:
    grid = Grid(np.zeros(3), 0.5, (8, 8, 8))
    assert extract_region(grid, np.zeros(grid.shape, np.float32)) is None
    assert extract_region(grid, np.full(grid.shape, -1, np.float32)) is None
