"""Noisy points averaged over as many neighbours as their surface allows."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry import local_fits
from damageest.geometry.local_fits import average_points, smooth_points

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


@pytest.mark.variants(1)
@pytest.mark.parametrize("radius", [np.inf, 20.0, 8.0])
def test_averaging_takes_off_noise_and_adds_no_bias(radius: float) -> None:
    points = cloud(radius)
    inner = middle(points)
    error = off(average_points(points, np.ones(len(points), np.int64), SIGMA, np.arange(len(points)))[0], radius)[inner]
    plain = off(smooth_points(points, SIGMA)[0], radius)[inner]
    assert error.std() < 0.3 * SIGMA
    assert error.std() < 0.75 * plain.std()
    assert abs(error.mean()) < 0.05 * SIGMA


@pytest.mark.slow
def test_a_sharp_edge_stays() -> None:
    rng = np.random.default_rng(5)
    flat = rng.uniform(-5, 5, (10_000, 2))
    roof = np.column_stack([flat, -np.abs(flat[:, 0])])
    noisy = roof + SIGMA * rng.normal(size=(10_000, 1)) * np.array([0, 0, 1])
    points, _ = average_points(noisy, np.ones(10_000, np.int64), SIGMA, np.arange(len(noisy)))
    height = (points[:, 2] + np.abs(points[:, 0])) / np.sqrt(2)
    near = np.abs(flat[:, 0]) < 0.5
    assert np.abs(height[near & middle(points)]).mean() < SIGMA


def test_points_are_fitted_in_pieces_of_any_size_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    points = cloud(8.0, 1500)
    chosen = np.arange(0, len(points), 3)

    def fit() -> list[bytes]:
        arrays = (*smooth_points(points, SIGMA), *average_points(points, np.ones(len(points), np.int64), SIGMA, chosen))
        return [array.tobytes() for array in arrays]

    before = fit()
    monkeypatch.setattr(local_fits, "CHUNK", 37)
    assert fit() == before


def test_few_points_on_the_walls_of_a_notch_face_across_them() -> None:
    """Three walls of a plate 5 thick, their points 3 apart: the planes of few points are narrow."""
    rng = np.random.default_rng(0)
    along, height = rng.uniform(0, 1, 54), rng.uniform(-2.4, 2.4, 54)
    wall = np.repeat([0, 1, 2], 18)
    x, y = np.where(wall == 1, 0.0, 23 * along), np.select([wall == 0, wall == 2], [0.0, 32.0], 32 * along)
    points = np.column_stack([x, y, height]) + 0.02 * rng.normal(size=(54, 3))
    _, normals = average_points(points, np.ones(54, np.int64), 0.02, np.arange(54))
    assert (np.abs(normals[:, 2]) < 0.5).mean() > 0.9
