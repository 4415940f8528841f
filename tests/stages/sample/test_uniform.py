"""Coverage, evenness, and the bound on the count."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

import damageest
from damageest.artefacts import Part
from damageest.stages.sample.uniform import Uniform
from tests import damaged_box


def as_part(mesh: trimesh.Trimesh) -> Part:
    return Part(mesh.vertices, mesh.faces)


PARTS = {
    "box": lambda: trimesh.creation.box((40, 30, 10)),
    "strips": lambda: trimesh.creation.cylinder(8, 40, sections=300),
    "fine": lambda: trimesh.creation.icosphere(5, 15),
    "sharp corner": lambda: trimesh.creation.cone(2, 60, sections=5),
}


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("tolerance", [0.5, 4.0])
def test_no_gap_above_the_stated_spacing(name: str, tolerance: float) -> None:
    mesh = PARTS[name]()
    samples = Uniform().run(as_part(mesh), tolerance)
    surface, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=3)
    assert samples.spacing == tolerance
    assert cKDTree(samples.points).query(np.concatenate([surface, mesh.vertices]))[0].max() <= samples.spacing
    assert not samples.kind.any()


@pytest.mark.parametrize("name", ["box", "strips", "fine"])
def test_even_whatever_the_triangles(name: str) -> None:
    mesh = PARTS[name]()
    samples = Uniform().run(as_part(mesh), 1.0)
    nearest = cKDTree(samples.points).query(samples.points, k=2)[0][:, 1]
    assert np.percentile(nearest, 1) > 0.6
    assert nearest.max() < 1.5
    assert len(samples.points) < 2.5 * mesh.area


def test_points_lie_inside_their_faces_and_normals_agree() -> None:
    mesh = PARTS["box"]()
    samples = Uniform().run(as_part(mesh), 1.0)
    corner = mesh.triangles[samples.face][:, 0]
    assert np.abs(((samples.points - corner) * mesh.face_normals[samples.face]).sum(1)).max() < 1e-12
    assert np.allclose(samples.normals, mesh.face_normals[samples.face])
    assert (np.isclose(np.abs(samples.points), [20, 15, 5]).sum(axis=1) == 1).all()  # none on an edge


def test_the_count_is_bounded_and_the_spacing_is_enlarged() -> None:
    mesh = PARTS["strips"]()
    samples = Uniform(max_points=5000).run(as_part(mesh), 0.01)
    assert len(samples.points) <= 5000
    assert samples.spacing > 0.01
    surface, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=3)
    assert cKDTree(samples.points).query(surface)[0].max() <= samples.spacing


def test_same_input_same_bytes() -> None:
    part = as_part(PARTS["fine"]())
    one, two = Uniform().run(part, 1.0), Uniform().run(part, 1.0)
    assert one.points.tobytes() == two.points.tobytes()
    assert one.face.tobytes() == two.face.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("method", ["implicit", "surface"])
def test_a_job_with_it_finds_the_right_volume(method: str) -> None:
    scan = {
        "use": "simulate",
        "points": 30_000,
        "noise": 0.04,
        "pose": "random",
        "damage": [{"tool": "sphere", "centre": [12, 8, 10], "radius": 6}],
    }
    box = trimesh.creation.box(damaged_box.SIZE)
    job = {"version": 1, "tolerance": 0.2, "method": method, "sample": "uniform", "scan": scan}
    result = damageest.run({**job, "part": Part(box.vertices, box.faces)})
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.03)
