"""Points spread over triangles lie on them, leave no gap, and are thinned the same way each time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from damageest.artefacts import Mesh
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.refinement import halve_edges
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.spreading import spread_on_faces, spread_points, thin
from tests.geometry.shapes import box, torus


@pytest.mark.parametrize("mesh", [box((20, 10, 5)), halve_edges(box((20, 10, 5)), 0.3), torus()], ids=str)
def test_every_place_of_a_mesh_is_near_a_point(mesh: Mesh) -> None:
    points, face = spread_on_faces(mesh, 0.5)
    places, _ = sample_by_area(mesh, 20_000, np.random.default_rng(0))
    assert cKDTree(points).query(places)[0].max() <= 0.5
    assert distance_to_mesh(points, mesh).max() < 1e-9
    off = ((points - mesh.triangles[face][:, 0]) * mesh.face_normals[face]).sum(axis=1)
    assert np.abs(off).max() < 1e-9


@given(st.integers(0, 10_000), st.floats(0.05, 2))
@settings(max_examples=40, deadline=None)
def test_one_triangle_of_any_shape_is_covered(seed: int, step: float) -> None:
    rng = np.random.default_rng(seed)
    triangle = rng.uniform(0, 1, (1, 3, 3)) * rng.choice([0.01, 1, 3], 3)
    points, of = spread_points(triangle, np.zeros(1, np.int64), step)
    assert not of.any()
    weights = rng.dirichlet([1, 1, 1], 500)
    assert cKDTree(points).query(weights @ triangle[0])[0].max() <= step


@given(st.integers(0, 10_000), st.floats(0.02, 0.3))
@settings(max_examples=25, deadline=None)
def test_thinned_points_are_apart_and_the_others_near(seed: int, apart: float) -> None:
    points = np.random.default_rng(seed).uniform(0, 1, (1500, 3))
    kept = thin(points, apart, 1.5 * apart)
    assert cKDTree(points[kept]).query(points)[0].max() <= 1.5 * apart
    assert (thin(points, apart, 1.5 * apart) == kept).all()
    assert len(np.unique(kept)) == len(kept)
