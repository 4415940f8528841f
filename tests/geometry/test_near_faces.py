"""Which skin comes nearest to conditions that select none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Part
from damageest.geometry.near_faces import measure_shortfall, name_nearest_skin
from damageest.geometry.selectors import Selector
from tests.geometry.shapes import box

BLOCK = box((10, 20, 30))
MESH = Part(BLOCK.vertices, BLOCK.faces)
SIDE = np.argmax(np.abs(MESH.face_normals), axis=1) * 2 + (MESH.face_normals.sum(axis=1) > 0)
"""The side of each triangle: 0 and 1 along x, 2 and 3 along y, 4 and 5 along z, the negative one first."""
CAD = replace(MESH, faces_brep=SIDE, face_names=("left", "right", "", "", "bottom", "top"), face_kinds=("plane",) * 6)


def test_the_nearest_faces_of_a_box_that_lies_beside() -> None:
    above = Selector(box=((-1, -1, 17), (1, 1, 19)))
    short = measure_shortfall(above, MESH)
    assert set(SIDE[short == short.min()]) <= {5}
    assert "the nearest CAD faces are 5 (top), " in name_nearest_skin(above, CAD)
    assert name_nearest_skin(above, MESH) == "the nearest skin is at (0, 0, 15)"


def test_a_plane_beyond_the_part_and_a_direction_that_no_face_has() -> None:
    beyond = Selector.model_validate({"half_space": {"point": [9, 0, 0], "normal": [1, 0, 0]}})
    assert set(SIDE[measure_shortfall(beyond, MESH) == measure_shortfall(beyond, MESH).min()]) >= {1}
    tilted = Selector.model_validate({"facing": {"direction": [0, 1, 2], "angle": 5}})
    assert name_nearest_skin(tilted, CAD).startswith("the nearest CAD faces are 5 (top), 3, ")


def test_what_is_selected_falls_short_of_nothing() -> None:
    top = Selector.model_validate({"facing": {"direction": [0, 0, 1]}})
    assert np.array_equal(measure_shortfall(top, MESH) == 0, SIDE == 5)
