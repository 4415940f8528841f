"""New points between those of a sparse scan lie on its surface, and not where it has none."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.stages.enclose._fill_gaps import fill_gaps

RADIUS = 5.0


def ball(count: int, seed: int = 0) -> tuple[Floats, Floats]:
    """Points (count,3) on the upper half of a sphere, and their normals."""
    normals = np.random.default_rng(seed).normal(size=(count, 3))
    normals[:, 2] = np.abs(normals[:, 2])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return RADIUS * normals, normals


def test_they_lie_on_the_surface_and_close_its_gaps() -> None:
    points, normals = ball(400)
    more, ways = fill_gaps(points, normals, np.zeros(len(points)), 0.1)
    new = more[len(points) :]
    assert len(new) > 10 * len(points)
    off = np.abs(np.linalg.norm(new, axis=1) - RADIUS)
    assert np.quantile(off, 0.9) < 0.01
    assert np.quantile(off, 0.99) < 0.04
    assert (np.einsum("ij,ij->i", ways, more) > 0.98 * RADIUS).all()
    inside, _ = ball(2000, 1)
    inside = inside[inside[:, 2] > 1.5]
    assert np.quantile(find_neighbours(inside, 1, more)[0], 0.95) < 0.15
    assert np.quantile(find_neighbours(inside, 1, points)[0], 0.95) > 0.3


def test_none_lies_in_a_hole_or_beyond_the_border() -> None:
    points, normals = ball(400)
    kept = np.linalg.norm(points - [0, 0, RADIUS], axis=1) > 2
    more, _ = fill_gaps(points[kept], normals[kept], np.zeros(int(kept.sum())), 0.1)
    assert np.linalg.norm(more - [0, 0, RADIUS], axis=1).min() > 1.6
    assert more[:, 2].min() > -0.3


@pytest.mark.parametrize("count", [0, 1, 8, 20_000])
def test_few_points_and_close_points_stay_alone(count: int) -> None:
    points, normals = ball(count)
    more, ways = fill_gaps(points, normals, np.zeros(len(points)), 0.1)
    assert more.tobytes() == points.tobytes()
    assert ways.tobytes() == normals.tobytes()
