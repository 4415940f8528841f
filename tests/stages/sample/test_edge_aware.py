"""Coverage, exactness and the bound on the count."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from damageest.artefacts import Part
from damageest.stages.sample.edge_aware import EdgeAware


def as_part(mesh: trimesh.Trimesh) -> Part:
    return Part(mesh.vertices, mesh.faces)


PARTS = {
    "box": lambda: trimesh.creation.box((40, 30, 10)),
    "strips": lambda: trimesh.creation.cylinder(8, 40, sections=300),
    "fine": lambda: trimesh.creation.icosphere(5, 15),
    "sharp corner": lambda: trimesh.creation.cone(2, 60, sections=5),
}


@pytest.mark.parametrize("name", PARTS)
@pytest.mark.parametrize("tolerance", [0.3, 1.0, 4.0])
def test_no_gap_above_the_stated_spacing(name: str, tolerance: float) -> None:
    mesh = PARTS[name]()
    samples = EdgeAware().run(as_part(mesh), tolerance)
    surface, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=3)
    assert samples.spacing == tolerance
    assert cKDTree(samples.points).query(np.concatenate([surface, mesh.vertices]))[0].max() <= samples.spacing
    # and not many more points than that takes
    assert len(samples.points) < 8 * mesh.area / tolerance**2 + 8 * 40 * 30 / tolerance + 100


def test_points_lie_on_their_faces_and_normals_agree() -> None:
    mesh = PARTS["box"]()
    samples = EdgeAware().run(as_part(mesh), 1.0)
    corner = mesh.triangles[samples.face][:, 0]
    assert np.abs(((samples.points - corner) * mesh.face_normals[samples.face]).sum(1)).max() < 1e-12
    on_face = samples.kind == 0
    assert np.allclose(samples.normals[on_face], mesh.face_normals[samples.face[on_face]])
    assert np.allclose(np.linalg.norm(samples.normals, axis=1), 1)


def test_box_has_its_edges_and_corners() -> None:
    mesh = PARTS["box"]()
    samples = EdgeAware().run(as_part(mesh), 1.0)
    half = np.array([20, 15, 5])
    at_limit = np.isclose(np.abs(samples.points), half).sum(axis=1)
    assert np.array_equal(at_limit, samples.kind + 1)
    corners = samples.points[samples.kind == 2]
    assert len(np.unique(corners.round(9), axis=0)) == len(corners) == 8
    assert np.allclose(samples.normals[samples.kind == 2], np.sign(corners) / np.sqrt(3))
    edge = samples.points[
        (samples.kind == 1) & np.isclose(samples.points[:, 1], 15) & np.isclose(samples.points[:, 2], 5)
    ]
    assert np.diff(np.sort(edge[:, 0])).max() <= 1.0


def test_smooth_part_has_no_sharp_edges_and_the_angle_decides() -> None:
    ball = as_part(PARTS["fine"]())
    assert (EdgeAware().run(ball, 1.0).kind == 0).all()
    hexagon = as_part(trimesh.creation.cylinder(8, 10, sections=6))
    sharp = (EdgeAware(angle=30).run(hexagon, 1.0).kind == 1).sum()
    assert 0 < (EdgeAware(angle=70).run(hexagon, 1.0).kind == 1).sum() < sharp


def test_finely_tessellated_rim_is_not_sampled_at_every_vertex() -> None:
    disc = trimesh.creation.cylinder(8, 10, sections=2000)
    samples = EdgeAware().run(as_part(disc), 1.0)
    rim = samples.points[samples.kind == 1]
    assert 100 < len(rim) < 500
    assert cKDTree(rim).query(disc.vertices[np.abs(disc.vertices[:, 2]) == 5])[0][2:].max() <= 8.0
    on_rim = disc.vertices[np.isclose(np.hypot(*disc.vertices[:, :2].T), 8)]
    assert cKDTree(rim).query(on_rim)[0].max() <= 1.0


def test_the_count_is_bounded_and_the_spacing_is_enlarged() -> None:
    mesh = PARTS["strips"]()
    samples = EdgeAware(max_points=5000).run(as_part(mesh), 0.01)
    assert len(samples.points) <= 5000
    assert samples.spacing > 0.01
    surface, _ = trimesh.sample.sample_surface(mesh, 20_000, seed=3)
    assert cKDTree(samples.points).query(surface)[0].max() <= samples.spacing


def test_same_input_same_bytes() -> None:
    part = as_part(PARTS["fine"]())
    one, two = EdgeAware().run(part, 1.0), EdgeAware().run(part, 1.0)
    assert one.points.tobytes() == two.points.tobytes()
    assert one.face.tobytes() == two.face.tobytes()
