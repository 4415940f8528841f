"""The scene of the tests of `pyvista`: a ball's lower half, from noisy points; and a job."""

from __future__ import annotations

import numpy as np
import pytest

import damageest
from damageest.artefacts import Part, Surface
from damageest.errors import StageError
from damageest.stages.reconstruct.signed_distance import SignedDistance
from tests.damaged_box import box
from tests.stages.reconstruct.test_pyvista import NOISE, RADIUS, TOLERANCE, TOP, measure_errors, scene


@pytest.fixture(scope="module")
def surface() -> Surface:
    points, part = scene()
    return SignedDistance().run(points, part, TOLERANCE, 0.15, NOISE)


def test_averages_the_noise(surface: Surface) -> None:
    assert np.sqrt((measure_errors(surface) ** 2).mean()) < 0.6 * NOISE
    assert np.abs(measure_errors(surface)).max() < TOLERANCE


def test_a_hollow_of_few_points_is_as_deep_as_it_is() -> None:
    points, part = scene()
    sparse = SignedDistance().run(points[::12], part, TOLERANCE, 0.55, NOISE)
    inner = np.abs(sparse.vertices[:, 2] - TOP) > 1
    assert np.median(measure_errors(sparse)[inner]) == pytest.approx(0, abs=0.003 * RADIUS)


def test_one_piece_with_one_rim_and_normals_toward_the_lost_material(surface: Surface) -> None:
    from damageest.stages.boundary.all_loops import AllLoops

    assert len(AllLoops().run(surface, scene()[1], TOLERANCE).loops) == 1
    assert surface.area == pytest.approx(2 * np.pi * RADIUS**2, rel=0.08)
    inward = np.array([0, 0, TOP]) - surface.triangles.mean(axis=1)
    assert (np.einsum("ij,ij->i", surface.cross, inward) > 0).mean() > 0.99


def test_same_points_same_bytes(surface: Surface) -> None:
    points, part = scene()
    again = SignedDistance().run(points, part, TOLERANCE, 0.15, NOISE)
    assert again.vertices.tobytes() == surface.vertices.tobytes()
    assert again.faces.tobytes() == surface.faces.tobytes()


def test_far_from_the_origin() -> None:
    points, part = scene()
    away = np.array([1e5, -2e5, 3e5])
    moved = SignedDistance().run(points + away, Part(part.vertices + away, part.faces), TOLERANCE, 0.15, NOISE)
    radius = np.linalg.norm(moved.vertices - away - [0, 0, TOP], axis=1) - RADIUS
    assert np.sqrt((radius**2).mean()) < 0.6 * NOISE


def test_too_few_points_are_refused() -> None:
    points, part = scene()
    with pytest.raises(StageError, match="at least 16 are needed") as caught:
        SignedDistance().run(points[:12], part, TOLERANCE, 0.15, NOISE)
    assert caught.value.remedy


PIT = {"tool": "sphere", "centre": [0, 0, 10], "radius": 6}
CUT = {"tool": "box", "centre": [20, 15, 10], "size": [14, 12, 10], "rotation": [0, 0, 20]}
BLOB = {"tool": "blob", "centre": [18, 0, 10], "radius": 7, "seed": 2}


@pytest.mark.variants(slow=2)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("tool", "density", "points"),
    [
        (PIT, 0.8, 25_000),
        *(
            pytest.param(tool, density, 60_000, marks=pytest.mark.slow)
            for tool in (PIT, CUT, BLOB)
            for density in (0.0, 0.8)
        ),
    ],
)
def test_jobs_with_it_find_the_damage(tool: dict, density: float, points: int) -> None:
    scan = {"use": "simulate", "points": points, "density": density, "damage": [tool]}
    job = {"version": 1, "tolerance": 0.15, "method": "surface", "align": "none", "reconstruct": "signed_distance"}
    result = damageest.run({**job, "part": box(), "scan": scan})
    assert result.truth[1] > 0.97
