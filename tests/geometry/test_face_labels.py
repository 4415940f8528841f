"""Labels of triangles are carried over to another mesh of the same surface."""

from __future__ import annotations

import numpy as np

from damageest.geometry.face_labels import carry_labels
from damageest.geometry.refinement import cut_into_cells
from tests.geometry.shapes import box

BOX = box(10.0)
SIDES = np.argmax(np.abs(BOX.face_normals), axis=1) * 2 + (BOX.face_normals.sum(axis=1) > 0)


def test_each_piece_of_a_triangle_has_its_label() -> None:
    cells, parent = cut_into_cells(BOX, 1.5, 0.0)
    carried = carry_labels(cells.vertices, cells.faces, BOX, SIDES)
    assert carried is not None
    assert np.array_equal(carried, SIDES[parent])


def test_there_are_none_where_a_triangle_lies_elsewhere() -> None:
    vertices = BOX.vertices.copy()
    vertices[0] += 0.5
    assert carry_labels(vertices, BOX.faces, BOX, SIDES) is None
