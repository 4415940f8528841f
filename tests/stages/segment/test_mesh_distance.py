"""Distance and sign against parts whose distance is known in closed form."""

from __future__ import annotations

import igl
import numpy as np
import trimesh

from damageest.artefacts import ADDED, DAMAGE, INTACT, Mesh, Part, Scan
from damageest.stages.segment.mesh_distance import MeshDistance, signed_distance

KIND = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
HALF = np.array([20.0, 15.0, 0.2])


def box_distance(points: np.ndarray) -> np.ndarray:
    q = np.abs(points) - HALF
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def thin_box() -> Mesh:
    mesh = trimesh.creation.box(2 * HALF)
    return Mesh(mesh.vertices, mesh.faces)


def queries(n: int = 20_000) -> np.ndarray:
    rng = np.random.default_rng(0)
    near = rng.uniform(-1, 1, (n, 3)) * (HALF + 0.5)
    edges = rng.choice([-1, 1], (n, 3)) * HALF + rng.normal(0, 0.05, (n, 3))
    return np.concatenate([near, edges])


def test_thin_plate_exact() -> None:
    points = queries()
    distance, face = signed_distance(points, thin_box())
    assert np.abs(distance - box_distance(points)).max() < 1e-12
    assert face.min() >= 0
    assert face.max() < 12


def test_far_from_the_origin() -> None:
    box, points = thin_box(), queries(2000)
    away = np.array([1e6, -3e6, 2e6])
    distance, _ = signed_distance(points + away, Mesh(box.vertices + away, box.faces))
    assert np.abs(distance - box_distance(points)).max() < 1e-8


def with_flat_triangles(mesh: Mesh) -> Mesh:
    """The same solid, one edge of which carries a triangle without area: its middle is joined to one side only."""
    vertices, faces = mesh.vertices, mesh.faces
    a, b, c = faces[0]
    m = len(vertices)
    middle = (vertices[a] + vertices[b]) / 2
    return Mesh(np.vstack([vertices, middle]), np.vstack([faces[1:], [[a, m, c], [m, b, c], [a, b, m]]]))


def test_flat_triangles_do_not_turn_the_sign() -> None:
    for turn in range(3):
        box = thin_box()
        faces = box.faces.copy()
        for i in range(12):
            rolled = np.roll(np.vstack([faces[i:], faces[:i]]), turn, axis=1)
            mesh = with_flat_triangles(Mesh(box.vertices, rolled))
            points = queries(2000)
            distance, _ = signed_distance(points, mesh)
            assert np.abs(distance - box_distance(points)).max() < 1e-9


def test_doubled_vertices_do_not_turn_the_sign() -> None:
    """Two boxes that meet along an edge, each with its own vertices there."""
    one = trimesh.creation.box((2, 2, 2))
    two = one.copy()
    two.apply_translation((2, 2, 0))
    mesh = Mesh(np.vstack([one.vertices, two.vertices]), np.vstack([one.faces, two.faces + 8]))
    points = np.random.default_rng(1).uniform(-2, 4, (20_000, 3))
    inside = (np.abs(points) < 1).all(1) | (np.abs(points - [2, 2, 0]) < 1).all(1)
    distance, _ = signed_distance(points, mesh)
    assert np.array_equal(distance < 0, inside)


def test_labels() -> None:
    mesh = trimesh.creation.box((10, 10, 10))
    points = np.array([[0, 0, 5.0], [0, 0, 4.85], [0, 0, 4.5], [0, 0, 5.15], [0, 0, 6.0]])
    part = Part(mesh.vertices, mesh.faces)
    deviation = MeshDistance().run(Scan(points), part, 0.2)
    assert deviation.label.tolist() == [INTACT, INTACT, DAMAGE, INTACT, ADDED]
    deviation = MeshDistance(threshold=0.5).run(Scan(points), part, 0.2)
    assert deviation.label.tolist() == [INTACT, DAMAGE, DAMAGE, ADDED, ADDED]
    assert np.allclose(deviation.distance, [0, -0.15, -0.5, 0.15, 1.0])


def test_empty_scan() -> None:
    mesh = trimesh.creation.box((10, 10, 10))
    assert len(MeshDistance().run(Scan(np.empty((0, 3))), Part(mesh.vertices, mesh.faces), 0.2).label) == 0


def test_sign_beside_the_short_edges_of_slender_triangles() -> None:
    """Round a bore with a cross hole, where long strips end on the hole's edge: the sign is that of the winding."""
    from damageest.evaluate.parts import PARTS

    part = PARTS["tube"]()
    vertices, faces = np.array(part.vertices), np.array(part.faces)
    points = np.random.default_rng(0).uniform([18, -6, 5], [24, 6, 12], (30_000, 3))
    inside = np.asarray(igl.fast_winding_number(vertices, faces, points)) > 0.5
    plain = igl.signed_distance(points, vertices, faces, sign_type=KIND)[0]
    assert not np.array_equal(plain < 0, inside)  # what libigl says of some of them, which is why this is tested
    assert np.array_equal(signed_distance(points, part)[0] < 0, inside)
