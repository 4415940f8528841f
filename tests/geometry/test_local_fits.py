"""Noisy points averaged over as many neighbours as their surface allows, and a mesh brought onto them."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Solid
from damageest.geometry.local_fits import average_points, smooth_points
from damageest.geometry.neighbourhoods import thin_points
from damageest.stages.enclose._refit import refit_region

SIGMA = 0.05


def cloud(radius: float, count: int = 8000) -> np.ndarray:
    """Noisy points on the upper cap of a ball, 5 across, about its pole at 0; flat where the radius is infinite."""
    rng = np.random.default_rng(3)
    flat = rng.uniform(-5, 5, (count, 2))
    drop = 0.0 if np.isinf(radius) else radius - np.sqrt(radius**2 - (flat**2).sum(axis=1))
    return np.column_stack([flat, SIGMA * rng.normal(size=count) - drop])


def middle(points: np.ndarray) -> np.ndarray:
    return np.asarray(np.hypot(*points[:, :2].T) < 4)


def off(points: np.ndarray, radius: float) -> np.ndarray:
    if np.isinf(radius):
        return np.asarray(points[:, 2])
    return np.linalg.norm(points - [0, 0, -radius], axis=1) - radius


@pytest.mark.parametrize("radius", [np.inf, 20.0, 8.0])
def test_averaging_takes_off_noise_and_adds_no_bias(radius: float) -> None:
    points = cloud(radius)
    inner = middle(points)
    error = off(average_points(points, np.ones(len(points), np.int64), SIGMA, np.arange(len(points)))[0], radius)[inner]
    plain = off(smooth_points(points, SIGMA)[0], radius)[inner]
    assert error.std() < 0.3 * SIGMA
    assert error.std() < 0.75 * plain.std()
    assert abs(error.mean()) < 0.05 * SIGMA


def test_a_sharp_edge_stays() -> None:
    rng = np.random.default_rng(5)
    flat = rng.uniform(-5, 5, (10_000, 2))
    roof = np.column_stack([flat, -np.abs(flat[:, 0])])
    noisy = roof + SIGMA * rng.normal(size=(10_000, 1)) * np.array([0, 0, 1])
    points, _ = average_points(noisy, np.ones(10_000, np.int64), SIGMA, np.arange(len(noisy)))
    height = (points[:, 2] + np.abs(points[:, 0])) / np.sqrt(2)
    near = np.abs(flat[:, 0]) < 0.5
    assert np.abs(height[near & middle(points)]).mean() < SIGMA


@given(st.integers(0, 1000), st.floats(0.1, 3))
@settings(max_examples=25, deadline=None)
def test_thinning_keeps_the_mean_and_the_count(seed: int, cell: float) -> None:
    points = np.random.default_rng(seed).normal(size=(200, 3))
    means, counts, first = thin_points(points, cell)
    assert counts.sum() == 200
    assert np.allclose(np.average(means, axis=0, weights=counts), points.mean(axis=0))
    assert (np.linalg.norm(points[first] - means, axis=1) <= np.sqrt(3) * cell).all()


def test_a_mesh_comes_onto_its_points_and_stays_closed() -> None:
    true = trimesh.creation.icosphere(5, 6.0)
    wavy = true.vertices * (1 + 0.01 * np.sin(3 * true.vertices[:, :1]))
    region = Solid(wavy, true.faces)
    points = trimesh.creation.icosphere(4, 6.0).vertices
    half = points[points[:, 2] > 0]
    fitted = refit_region(region, half, -half / 6, 0.2)
    radius = np.linalg.norm(fitted.vertices, axis=1)
    above, below = true.vertices[:, 2] > 0.6, true.vertices[:, 2] < -0.8
    assert np.abs(radius[above] - 6).max() < 0.006
    assert np.array_equal(fitted.vertices[below], region.vertices[below])
