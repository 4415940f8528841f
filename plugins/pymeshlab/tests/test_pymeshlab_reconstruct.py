"""PyMeshLab's reconstructions: a bowl from noisy points by each filter, and whole jobs against known truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from damageest_pymeshlab.reconstruct import PyMeshLabReconstruct

import damageest
from damageest.artefacts import Part, Surface
from damageest.errors import StageError
from damageest.stages.scan.simulate import Simulate
from tests.needs import needs_plugin

RADIUS, TOP, NOISE, TOLERANCE = 6.0, 10.0, 0.05, 0.2
FILTERS = ["screened_poisson", "apss", "rimls", "ball_pivoting"]

pytestmark = needs_plugin("pymeshlab")


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


def reconstruct(name: str, away: Any = (0.0, 0.0, 0.0)) -> Surface:
    part = box()
    stage = PyMeshLabReconstruct.model_validate({"filter": name})
    return stage.run(bowl() + away, Part(part.vertices + away, part.faces), TOLERANCE, 0.15, NOISE)


@pytest.fixture(scope="module", params=FILTERS)
def made(request: pytest.FixtureRequest) -> tuple[str, Surface]:
    return request.param, reconstruct(request.param)


@pytest.mark.variants(1)
def test_averages_the_noise(made: tuple[str, Surface]) -> None:
    off = np.linalg.norm(made[1].vertices - [0, 0, TOP], axis=1) - RADIUS
    assert np.sqrt((off**2).mean()) < 0.6 * NOISE
    assert np.abs(off).max() < TOLERANCE


def test_one_rim_that_ends_where_the_points_do(made: tuple[str, Surface]) -> None:
    from damageest.stages.boundary.all_loops import AllLoops

    name, surface = made
    rim, *holes = AllLoops().run(surface, box(), TOLERANCE).loops
    assert not holes or name == "ball_pivoting"
    assert surface.vertices[:, 2].max() < TOP + 0.5 * TOLERANCE
    assert surface.vertices[rim, 2].min() > TOP - 6 * TOLERANCE
    assert surface.area == pytest.approx(2 * np.pi * RADIUS**2, rel=0.1)


def test_normals_toward_the_lost_material(made: tuple[str, Surface]) -> None:
    inward = np.array([0, 0, TOP]) - made[1].triangles.mean(axis=1)
    assert (np.einsum("ij,ij->i", made[1].cross, inward) > 0).mean() > 0.99


@pytest.mark.slow
def test_same_points_same_surface_and_no_output(made: tuple[str, Surface], capfd: pytest.CaptureFixture[str]) -> None:
    again = reconstruct(made[0])
    # The grid of the MLS filters depends on the layout of memory: it moves by 4e-7, and single vertices by more.
    apart = np.abs(again.vertices - made[1].vertices).max(axis=1)
    assert np.median(apart) <= (1e-5 if made[0] in ("apss", "rimls") else 0)
    assert apart.max() <= (0.1 * NOISE if made[0] in ("apss", "rimls") else 0)
    assert again.faces.tobytes() == made[1].faces.tobytes()
    assert capfd.readouterr() == ("", "")


def test_far_from_the_origin() -> None:
    away = np.array([1e5, -2e5, 3e5])
    off = np.linalg.norm(reconstruct("apss", away).vertices - away - [0, 0, TOP], axis=1) - RADIUS
    assert np.sqrt((off**2).mean()) < 0.6 * NOISE


def test_too_few_points_are_refused() -> None:
    with pytest.raises(StageError, match="at least 16 are needed") as caught:
        PyMeshLabReconstruct().run(bowl()[:12], box(), TOLERANCE, 0.15, NOISE)
    assert caught.value.remedy


def test_a_ball_too_small_for_the_points_gives_no_surface() -> None:
    with pytest.raises(StageError, match="gives no inner damage surface"):
        PyMeshLabReconstruct(filter="ball_pivoting", radius=0.501, spacing=0.02).run(
            bowl(400), box(), TOLERANCE, 0.15, NOISE
        )


@pytest.mark.slow
@pytest.mark.parametrize("density", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_whole_job_comes_near_the_truth(density: float, capfd: pytest.CaptureFixture[str]) -> None:
    part = box()
    tool = {"tool": "sphere", "centre": [0, 0, TOP], "radius": RADIUS}
    scanner = Simulate.model_validate(
        {"damage": [tool], "points": 30000 if density else 8000, "noise": 0.04, "density": density}
    )
    job = {"version": 1, "method": "surface", "tolerance": TOLERANCE, "align": "none", "boolean": "pymeshlab"}
    result = damageest.run(job | {"reconstruct": "pymeshlab"}, part=part, scan=scanner.run("mm", part))
    assert result.truth is not None
    assert result.truth[1] > 0.95
    assert capfd.readouterr().out == ""
