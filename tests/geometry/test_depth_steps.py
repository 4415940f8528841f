"""Depth in steps is found along any direction, and is not taken for a raster, a rounding or plane faces."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats
from damageest.geometry.depth_steps import measure_depth_step
from damageest.geometry.sampling import sample_by_area

TURN = Rotation.from_euler("xyz", [20, 35, 50], degrees=True).as_matrix()


def sample(name: str, noise: float = 0.05) -> Floats:
    rng = np.random.default_rng(3)
    points = sample_by_area(PARTS[name](), 40_000, rng)[0] @ TURN.T
    return np.asarray(points + rng.normal(0, noise, points.shape) if noise else points)


def round_depth(points: Floats, step: float) -> Floats:
    return np.column_stack([points[:, :2], step * np.round(points[:, 2] / step)])


@pytest.mark.parametrize("name", ["block", "half_torus", "cuboid"])
@pytest.mark.parametrize("step", [0.5, 1.0])
def test_steps_along_an_axis(name: str, step: float) -> None:
    assert measure_depth_step(round_depth(sample(name), step)) == pytest.approx(step, rel=0.02)


def test_steps_of_a_scan_that_was_turned() -> None:
    points = (round_depth(sample("block"), 1.0) @ TURN.T).astype(np.float32)
    assert measure_depth_step(points) == pytest.approx(1.0, rel=0.02)


def test_steps_of_the_distance_from_the_scanner() -> None:
    points, scanner = sample("block"), np.array([100.0, 200, 300])
    way = points - scanner
    length = np.linalg.norm(way, axis=1, keepdims=True)
    points = scanner + way / length * np.round(length)
    view = np.zeros(len(points), np.int32)
    assert measure_depth_step(points, scanner[None], view) == pytest.approx(1.0, rel=0.02)
    assert measure_depth_step(points) == 0


@pytest.mark.parametrize("name", ["block", "grille", "gear"])
def test_continuous_depth_has_none(name: str) -> None:
    assert measure_depth_step(sample(name)) == 0
    assert measure_depth_step(sample(name, 0.0) @ TURN) == 0, "faces square to an axis, without noise"
    assert measure_depth_step(np.round(sample(name), 3)) == 0


def test_a_raster_has_none() -> None:
    x, y = (each.ravel() for each in np.meshgrid(np.arange(0, 60, 0.3), np.arange(0, 60, 0.3)))
    points = np.column_stack([x, y, 5 * np.sin(x / 7) + 0.3 * y])
    assert measure_depth_step(points) == 0
    assert measure_depth_step(round_depth(points, 1.0)) == pytest.approx(1.0)


def test_few_points_and_points_that_are_not_finite() -> None:
    assert measure_depth_step(np.zeros((10, 3))) == 0
    assert measure_depth_step(np.zeros((2000, 3))) == 0
    assert measure_depth_step(np.full((2000, 3), np.nan)) == 0


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_mesh_whose_vertices_stand_in_rows_has_none(noise: float) -> None:
    """Its walls have few heights, and its edges deviate from a plane as terraces do."""
    pitch, size, sides = 1.25, np.array([70.0, 40.0, 20.0]), []
    for axis in range(3):
        a, b = (k for k in range(3) if k != axis)
        rows = np.stack(np.meshgrid(*(np.arange(0, size[k] + pitch / 2, pitch) for k in (a, b))), -1).reshape(-1, 2)
        for end in (0.0, size[axis]):
            side = np.full((len(rows), 3), end)
            side[:, (a, b)] = rows
            side[:, axis] += noise * np.random.default_rng(axis).normal(size=len(rows))
            sides.append(side)
    points = np.concatenate(sides)
    assert measure_depth_step(points) == 0
    assert measure_depth_step((points @ TURN.T).astype(np.float32)) == 0
