"""A ball's lower half, from noisy points."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Part, Surface
from damageest.errors import StageError
from damageest.stages.reconstruct.pyvista import PyVista

pytestmark = pytest.mark.needs("pyvista")

RADIUS, TOP, NOISE, TOLERANCE = 6.0, 10.0, 0.05, 0.2


def scene(n: int = 6000) -> tuple[np.ndarray, Part]:
    """Points of a bowl let into the top of a box, at height 10."""
    box = trimesh.creation.box((40, 30, 20))
    rng = np.random.default_rng(0)
    out = rng.normal(size=(n, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    out[:, 2] = -np.abs(out[:, 2])
    points = out * RADIUS + [0, 0, TOP] + rng.normal(0, NOISE, (n, 3))
    return points[points[:, 2] < TOP - TOLERANCE], Part(box.vertices, box.faces)


@pytest.fixture(scope="module")
def surface() -> Surface:
    points, part = scene()
    return PyVista().run(points, part, TOLERANCE, 0.15, NOISE)


def measure_errors(surface: Surface) -> np.ndarray:
    return np.linalg.norm(surface.vertices - [0, 0, TOP], axis=1) - RADIUS


def test_averages_the_noise(surface: Surface) -> None:
    assert np.sqrt((measure_errors(surface) ** 2).mean()) < 0.6 * NOISE
    assert np.abs(measure_errors(surface)).max() < TOLERANCE


def test_one_piece_with_one_rim_that_ends_where_the_points_do(surface: Surface) -> None:
    from damageest.stages.boundary.all_loops import AllLoops

    (rim,) = AllLoops().run(surface, scene()[1], TOLERANCE).loops
    assert surface.vertices[:, 2].max() < TOP - TOLERANCE + 1.5 * TOLERANCE
    assert surface.vertices[rim, 2].min() > TOP - 6 * TOLERANCE
    assert surface.area == pytest.approx(2 * np.pi * RADIUS**2, rel=0.08)


def test_normals_toward_the_lost_material(surface: Surface) -> None:
    inward = np.array([0, 0, TOP]) - surface.triangles.mean(axis=1)
    assert (np.einsum("ij,ij->i", surface.cross, inward) > 0).mean() > 0.99


@pytest.mark.slow
def test_same_points_same_bytes(surface: Surface) -> None:
    points, part = scene()
    again = PyVista().run(points, part, TOLERANCE, 0.15, NOISE)
    assert again.vertices.tobytes() == surface.vertices.tobytes()
    assert again.faces.tobytes() == surface.faces.tobytes()


def test_far_from_the_origin(surface: Surface) -> None:
    points, part = scene()
    away = np.array([1e5, -2e5, 3e5])
    moved = PyVista().run(points + away, Part(part.vertices + away, part.faces), TOLERANCE, 0.15, NOISE)
    radius = np.linalg.norm(moved.vertices - away - [0, 0, TOP], axis=1) - RADIUS
    assert np.sqrt((radius**2).mean()) < 0.6 * NOISE


def test_too_few_points_are_refused() -> None:
    points, part = scene()
    with pytest.raises(StageError, match="at least 16 are needed") as caught:
        PyVista().run(points[:12], part, TOLERANCE, 0.15, NOISE)
    assert caught.value.remedy


def test_a_small_damage_has_a_surface() -> None:
    points, part = scene()
    small = points[np.argsort(np.linalg.norm(points - points[0], axis=1))[:40]]
    surface = PyVista().run(small, part, TOLERANCE, 0.15, NOISE)
    assert len(surface.faces) > 20
    assert np.linalg.norm(surface.vertices - points[0], axis=1).max() < 2
