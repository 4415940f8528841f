"""Triangles cut along the zero line of a field."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.geometry.cutting import cut_triangles
from damageest.geometry.solids import to_arrays


def test_skin_is_cut_without_gaps() -> None:
    """Into halves of the right area, whose common border has the same vertices."""
    rng = np.random.default_rng(3)
    ball = Manifold.sphere(1, 40)
    vertices, faces = to_arrays(ball)
    normal = rng.normal(size=3)
    value = vertices @ (normal / np.linalg.norm(normal)) - 0.21
    value[np.abs(value) < 0.02] = 0  # some of the vertices on the plane
    cut_vertices, cut_faces, parent, positive = cut_triangles(vertices, faces, value)
    corners = cut_vertices[cut_faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    before = vertices[faces]
    whole = np.linalg.norm(np.cross(before[:, 1] - before[:, 0], before[:, 2] - before[:, 0]), axis=1)
    assert np.bincount(parent, area, len(faces)) == pytest.approx(whole)
    edges = np.sort(np.concatenate([cut_faces[:, [0, 1]], cut_faces[:, [1, 2]], cut_faces[:, [2, 0]]]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    middle = np.concatenate([value, np.zeros(len(cut_vertices) - len(value))])[cut_faces]
    assert (middle[positive] >= 0).all()
    assert (middle[~positive] <= 0).all()
