"""Triangles cut into short pieces for a tree."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Floats, Mesh
from damageest.geometry import long_faces
from damageest.geometry.distance import SurfaceTree, closest_on_mesh
from damageest.geometry.long_faces import SHORT, cut_long_faces
from damageest.geometry.vectors import measure_longest_edges
from tests.geometry.shapes import ball, box


def _make_slivers(count: int, seed: int) -> Mesh:
    """Long thin triangles all over a box, and small ones among them."""
    rng = np.random.default_rng(seed)
    start, along = rng.uniform(-10, 10, (count, 3)), rng.uniform(-30, 30, (count, 3))
    corners = np.stack([start, start + along, start + 0.01 * rng.normal(size=(count, 3))], axis=1)
    corners[::3] = start[::3, None] + 0.1 * rng.normal(size=(len(corners[::3]), 3, 3))
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


@given(seed=st.integers(0, 10**6), count=st.integers(1, 40))
@settings(max_examples=40, deadline=None)
def test_pieces_are_short_and_cover_the_triangles(seed: int, count: int) -> None:
    mesh = _make_slivers(count, seed)
    vertices, faces, origin = cut_long_faces(mesh.vertices, mesh.faces)
    np.testing.assert_array_equal(vertices[: len(mesh.vertices)], mesh.vertices)
    corners = vertices[faces]
    if len(faces) > len(mesh.faces):
        assert measure_longest_edges(corners).max() <= SHORT * mesh.diagonal * (1 + 1e-12)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    whole = np.stack([np.bincount(origin, column, len(mesh.faces)) for column in cross.T], axis=1)
    np.testing.assert_allclose(whole, mesh.cross, atol=1e-9)  # vectors: each piece faces as its triangle does


@pytest.mark.parametrize("solid", [box((40, 3, 1)), ball(5.0, subdivisions=1)])
def test_the_nearest_triangles_are_those_of_the_mesh(solid: Mesh) -> None:
    rng = np.random.default_rng(0)
    asked = rng.uniform(-25, 25, (3000, 3))
    found = closest_on_mesh(asked, solid)
    np.testing.assert_allclose(np.linalg.norm(asked - found.place, axis=1), found.distance, atol=1e-9)
    for number in range(len(solid.faces)):
        alone = SurfaceTree(Mesh(solid.vertices, solid.faces[[number]])).closest(asked)
        assert (found.distance <= alone.distance + 1e-9).all()
        own = found.face == number
        np.testing.assert_allclose(found.distance[own], alone.distance[own], atol=1e-9)
        np.testing.assert_allclose(found.place[own], alone.place[own], atol=1e-9)


def test_boxes_that_are_tight_stay_and_others_become_tight() -> None:
    bar = trimesh.creation.box((40, 3, 1))
    assert len(cut_long_faces(np.asarray(bar.vertices), np.asarray(bar.faces))[1]) == len(bar.faces)
    bar.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 0.3]))
    assert len(cut_long_faces(np.asarray(bar.vertices), np.asarray(bar.faces))[1]) > len(bar.faces)


def test_many_long_triangles_do_not_become_millions(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = _make_slivers(1000, 1)
    every = len(cut_long_faces(mesh.vertices, mesh.faces)[1])
    monkeypatch.setattr(long_faces, "MOST_MORE", 100)
    fewer = len(cut_long_faces(mesh.vertices, mesh.faces)[1])
    assert len(mesh.faces) <= fewer < 3 * len(mesh.faces) < every


@pytest.mark.parametrize("vertices", [np.zeros((3, 3)), np.array([[0.0, 0, 0], [1e-320, 0, 0], [0, 1e-320, 0]])])
def test_triangles_without_size_stay(vertices: Floats) -> None:
    assert len(cut_long_faces(vertices, np.array([[0, 1, 2]]))[1]) >= 1
