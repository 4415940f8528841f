"""Ball pivoting: a bowl from noisy points, a whole job against known truth."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from damageest_open3d.ball_pivot import BallPivot

import damageest
from damageest.artefacts import Part, Surface
from damageest.errors import StageError
from damageest.stages.scan.simulate import Simulate
from tests.needs import needs_plugin

RADIUS, TOP, NOISE, TOLERANCE = 6.0, 10.0, 0.05, 0.2

pytestmark = needs_plugin("open3d")


def box() -> Part:
    mesh = trimesh.creation.box((40, 30, 20))
    return Part(mesh.vertices, mesh.faces)


def bowl(n: int = 6000) -> np.ndarray:
    """Points of a bowl let into the top of a box, at height 10."""
    rng = np.random.default_rng(0)
    out = rng.normal(size=(n, 3))
    out /= np.linalg.norm(out, axis=1)[:, None]
    out[:, 2] = -np.abs(out[:, 2])
    points = out * RADIUS + [0, 0, TOP] + rng.normal(0, NOISE, (n, 3))
    return np.asarray(points[points[:, 2] < TOP - TOLERANCE])


@pytest.fixture(scope="module")
def surface() -> Surface:
    return BallPivot().run(bowl(), box(), TOLERANCE, 0.15, NOISE)


def test_averages_the_noise(surface: Surface) -> None:
    off = np.linalg.norm(surface.vertices - [0, 0, TOP], axis=1) - RADIUS
    assert np.sqrt((off**2).mean()) < 0.6 * NOISE
    assert np.abs(off).max() < TOLERANCE


def test_one_rim_that_ends_where_the_points_do(surface: Surface) -> None:
    from damageest.stages.boundary.all_loops import AllLoops

    (rim,) = AllLoops().run(surface, box(), TOLERANCE).loops
    assert surface.vertices[:, 2].max() < TOP - TOLERANCE / 2
    assert surface.vertices[rim, 2].min() > TOP - 6 * TOLERANCE
    assert surface.area == pytest.approx(2 * np.pi * RADIUS**2, rel=0.09)


def test_normals_toward_the_lost_material(surface: Surface) -> None:
    inward = np.array([0, 0, TOP]) - surface.triangles.mean(axis=1)
    assert (np.einsum("ij,ij->i", surface.cross, inward) > 0).mean() > 0.99


@pytest.mark.slow
def test_same_points_same_bytes(surface: Surface) -> None:
    again = BallPivot().run(bowl(), box(), TOLERANCE, 0.15, NOISE)
    assert again.vertices.tobytes() == surface.vertices.tobytes()
    assert again.faces.tobytes() == surface.faces.tobytes()


@pytest.mark.slow
def test_far_from_the_origin() -> None:
    away, part = np.array([1e5, -2e5, 3e5]), box()
    moved = BallPivot().run(bowl() + away, Part(part.vertices + away, part.faces), TOLERANCE, 0.15, NOISE)
    off = np.linalg.norm(moved.vertices - away - [0, 0, TOP], axis=1) - RADIUS
    assert np.sqrt((off**2).mean()) < 0.6 * NOISE


@pytest.mark.variants(1)
@pytest.mark.parametrize("share", [1.0, 0.1])
def test_a_hollow_is_as_deep_as_it_is_also_where_a_half_is_sparse(share: float) -> None:
    """Chords would make it shallower, where the points are sparse by many times as much."""
    points = bowl(3000)
    drawn = np.random.default_rng(1).random(len(points))
    surface = BallPivot().run(points[(points[:, 0] < 0) | (drawn < share)], box(), TOLERANCE, 0.3, NOISE)
    middle = surface.triangles.mean(axis=1)
    far = np.linalg.norm(middle - [0, 0, TOP], axis=1)
    for half in (middle[:, 0] < 0, middle[:, 0] > 0):
        assert np.average(far[half], weights=np.linalg.norm(surface.cross[half], axis=1)) == pytest.approx(
            RADIUS, rel=0.005
        )


def test_a_ball_too_small_for_the_points_gives_no_surface() -> None:
    with pytest.raises(StageError, match="gives no inner damage surface") as caught:
        BallPivot(radii=(0.01,)).run(bowl(), box(), TOLERANCE, 0.15, NOISE)
    assert "spacing" in caught.value.remedy


def test_too_few_points_are_refused() -> None:
    with pytest.raises(StageError, match="at least 16 are needed") as caught:
        BallPivot().run(bowl()[:12], box(), TOLERANCE, 0.15, NOISE)
    assert caught.value.remedy


@pytest.mark.slow
@pytest.mark.parametrize("density", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_whole_job_comes_near_the_truth(density: float, capfd: pytest.CaptureFixture[str]) -> None:
    part = box()
    tool = {"tool": "sphere", "centre": [0, 0, TOP], "radius": RADIUS}
    scanner = Simulate.model_validate(
        {"damage": [tool], "points": 30000 if density else 8000, "noise": 0.04, "density": density}
    )
    job = {"version": 1, "method": "surface", "tolerance": TOLERANCE, "align": "none", "reconstruct": "ball_pivot"}
    result = damageest.run(job, part=part, scan=scanner.run("mm", part))
    assert result.truth is not None
    assert result.truth[1] > 0.95
    assert capfd.readouterr().out == ""
