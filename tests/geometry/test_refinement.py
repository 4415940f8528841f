"""Refined meshes: the same surface, closed, with short edges where they are wanted."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Mesh, open_edges
from damageest.geometry.refinement import bisect_faces, find_nearest, halve_edges, insert_points, refine_at


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.05, 20))
def test_refining_and_putting_points_in_keeps_the_shape(seed: int, edge: float) -> None:
    rng = np.random.default_rng(seed)
    box = trimesh.creation.box((40, 30, 20)) if seed % 2 else trimesh.creation.cylinder(10, 50, sections=40)
    mesh = Mesh(box.vertices, box.faces)
    face, foot = find_nearest(mesh, rng.normal(0, 15, (20, 3)))
    fine, held = refine_at(mesh, face, foot, edge)
    full, image = insert_points(fine, held, foot)
    for made in (fine, full):
        assert open_edges(made.faces) == 0
        assert trimesh.Trimesh(made.vertices, made.faces).volume == pytest.approx(box.volume)
    corners = fine.triangles[np.unique(held)]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= edge
    # a point near a vertex is that vertex
    assert np.linalg.norm(full.vertices[image] - foot, axis=1).max() <= 0.5 * edge + 1e-9
    assert np.abs(find_nearest(mesh, full.vertices)[1] - full.vertices).max() < 1e-9


def test_halved_everywhere() -> None:
    rod = trimesh.creation.cylinder(10, 50, sections=40)
    fine = halve_edges(Mesh(rod.vertices, rod.faces), 1.0)
    assert open_edges(fine.faces) == 0
    corners = fine.triangles
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() <= 1.0
    assert trimesh.Trimesh(fine.vertices, fine.faces).volume == pytest.approx(rod.volume)


@given(seed=st.integers(0, 10**6), share=st.sampled_from([0.0, 0.02, 1.0]))
@settings(max_examples=25, deadline=None)
def test_halving_a_few_faces_leaves_the_mesh_closed_and_the_others_as_they_are(seed: int, share: float) -> None:
    """Only faces about those to be halved are looked at, however far halving goes on."""
    ball = trimesh.creation.icosphere(4, 10.0)
    rng = np.random.default_rng(seed)
    wanted = np.unique(rng.integers(0, len(ball.faces), 1 + int(share * len(ball.faces))))
    vertices, faces, parent = bisect_faces(np.asarray(ball.vertices), np.asarray(ball.faces), wanted)
    assert open_edges(faces) == 0
    same = np.flatnonzero(np.bincount(parent, minlength=len(ball.faces)) == 1)
    assert not np.isin(wanted, same).any()
    kept = np.flatnonzero(np.isin(parent, same))
    np.testing.assert_array_equal(faces[kept], ball.faces[parent[kept]])
    area = np.linalg.norm(Mesh(vertices, faces).cross, axis=1)
    of_parent = np.bincount(parent, area, len(ball.faces))
    np.testing.assert_allclose(of_parent, 2 * ball.area_faces, rtol=1e-9)
