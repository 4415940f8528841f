"""Distances to samples compared with exact ones, on faces, at edges and on curved parts."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS

from damageest.artefacts import ADDED, DAMAGE, INTACT, Part, Scan
from damageest.errors import StageError
from damageest.stages.sample.edge_aware import EdgeAware
from damageest.stages.sample.uniform import Uniform
from damageest.stages.scan.simulate import Simulate
from damageest.stages.segment.cloud_distance import CloudDistance
from damageest.stages.segment.mesh_distance import MeshDistance, signed_distance


def box() -> Part:
    mesh = trimesh.creation.box((20, 15, 10))
    return Part(mesh.vertices, mesh.faces)


def around(part: Part, far: float, n: int = 20_000) -> np.ndarray:
    """Points within ``far`` of the surface, edges and corners included."""
    rng = np.random.default_rng(0)
    on, _ = trimesh.sample.sample_surface(trimesh.Trimesh(part.vertices, part.faces, process=False), n, seed=1)
    return on + rng.uniform(-far, far, (n, 3))


@pytest.mark.parametrize("sampler", [EdgeAware, Uniform])
def test_flat_faces_are_exact_and_the_sign_holds_at_edges(sampler: type) -> None:
    part, tolerance = box(), 0.5
    samples = sampler().run(part, tolerance)
    points = around(part, 2.0)
    exact, _ = signed_distance(points, part)
    got = CloudDistance().run(Scan(points), samples, tolerance)
    depth = np.sort([10, 7.5, 5] - np.abs(points), axis=1)
    inside = (depth[:, 0] > 0) & (depth[:, 1] > depth[:, 0] + 0.1)  # in the material, one face clearly the nearest
    beside = (depth[:, 0] < 0) & (depth[:, 1] > tolerance - depth[:, 0])  # outside one face, well away from its edges
    for clear in (inside, beside):
        assert clear.sum() > 2000
        assert np.abs(got.distance - exact)[clear].max() < 1e-9
    beyond = np.abs(exact) > 1.2 * tolerance
    assert np.array_equal(np.sign(got.distance[beyond]), np.sign(exact[beyond]))
    assert np.percentile(np.abs(np.abs(got.distance) - np.abs(exact)), 99.9) < tolerance


def test_plain_is_the_distance_to_the_points_and_needs_them_dense() -> None:
    part, tolerance = box(), 0.5
    points = around(part, 2.0)
    with pytest.raises(StageError, match="too coarse") as caught:
        CloudDistance(measure="plain").run(Scan(points), EdgeAware().run(part, tolerance), tolerance)
    assert "spacing" in caught.value.remedy
    samples = Uniform(spacing=0.5).run(part, tolerance)
    got = CloudDistance(measure="plain").run(Scan(points), samples, tolerance).distance
    exact = np.abs(signed_distance(points, part)[0])
    assert (np.abs(got) >= exact - 1e-9).all()
    assert (np.abs(got) <= exact + samples.spacing).all()


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", ["block", "blade", "gear"])
def test_labels_agree_with_the_exact_ones(name: str) -> None:
    part = PARTS[name]()
    sigma = 0.0005 * part.diagonal
    tolerance = 5 * sigma
    corner = part.vertices[np.argmax(part.vertices @ [1.0, 0.8, 0.6])]
    tool = {"tool": "sphere", "centre": corner.tolist(), "radius": 0.1 * part.diagonal}
    scan = Simulate.model_validate({"damage": [tool], "points": 40_000}).run("mm", part)
    exact = MeshDistance().run(scan, part, tolerance)
    got = CloudDistance().run(scan, EdgeAware().run(part, tolerance), tolerance)
    assert (exact.label == DAMAGE).sum() > 50
    assert (got.label != exact.label).mean() < 0.003
    deep = np.abs(exact.distance) > 1.5 * tolerance
    assert np.array_equal(got.label[deep], exact.label[deep])
    assert (got.label[np.abs(exact.distance) < 2 * sigma] == INTACT).mean() > 0.999


def test_metal_added_beside_an_edge_is_not_damage() -> None:
    """Above one face, on the plane of the next."""
    points = np.column_stack([np.full(50, 9.95), np.linspace(-5, 5, 50), np.full(50, 6.5)])
    part = box()
    assert (CloudDistance().run(Scan(points), EdgeAware().run(part, 0.5), 0.5).label == ADDED).all()


def test_faces_are_those_of_the_part_and_an_empty_scan_has_none() -> None:
    part = box()
    samples = EdgeAware().run(part, 0.5)
    points = np.array([[0, 0, 5.1], [10.1, 0, 0], [0, -7.6, 0]])
    face = CloudDistance().run(Scan(points), samples, 0.5).face
    normal = part.cross[face] / np.linalg.norm(part.cross[face], axis=1)[:, None]
    assert np.allclose(normal, [[0, 0, 1], [1, 0, 0], [0, -1, 0]])
    assert len(CloudDistance().run(Scan(np.empty((0, 3))), samples, 0.5).label) == 0
