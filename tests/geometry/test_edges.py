"""The edges of triangles, and the faces at each."""

from __future__ import annotations

import numpy as np

from damageest.geometry.edges import list_edges, pair_faces
from tests.damaged_box import box


def test_edges_come_triangle_by_triangle_with_the_lower_vertex_first() -> None:
    assert list_edges(np.array([[2, 0, 1], [1, 3, 2]])).tolist() == [[0, 2], [0, 1], [1, 2], [1, 3], [2, 3], [1, 2]]


def test_each_edge_of_a_closed_mesh_runs_from_start_to_end_in_its_first_face() -> None:
    faces = box().faces
    starts, ends, first, second = pair_faces(faces)
    assert len(starts) == 3 * len(faces) // 2
    pairs = {(int(a), int(b)) for face in faces for a, b in zip(face, np.roll(face, -1), strict=True)}
    assert set(zip(starts.tolist(), ends.tolist(), strict=True)) <= pairs
    for one in (first, second):
        assert ((faces[one] == starts[:, None]).any(axis=1) & (faces[one] == ends[:, None]).any(axis=1)).all()
    assert (first != second).all()
