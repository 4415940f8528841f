"""Smooth pieces of meshes end at their edges."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.geometry.smooth_faces import label_smooth_faces

SMOOTH = float(np.cos(np.radians(12.0)))


def count(mesh: trimesh.Trimesh) -> int:
    return len(np.unique(label_smooth_faces(mesh.faces, mesh.face_normals, SMOOTH)))


@pytest.mark.parametrize(
    ("mesh", "pieces"),
    [
        (trimesh.creation.box((1, 2, 3)), 6),
        (trimesh.creation.cylinder(1.0, 2.0, sections=64), 3),
        (trimesh.creation.icosphere(subdivisions=4), 1),
    ],
)
def test_faces_of_known_shapes(mesh: trimesh.Trimesh, pieces: int) -> None:
    assert count(mesh) == pieces
    assert count(mesh.subdivide()) == pieces


def test_pieces_that_do_not_touch_are_apart() -> None:
    plate = trimesh.creation.box((1, 2, 3))
    other = plate.copy()
    other.apply_translation([10, 0, 0])
    assert count(trimesh.util.concatenate([plate, other])) == 12


def test_each_triangle_of_a_face_has_its_number() -> None:
    box = trimesh.creation.box((1, 2, 3)).subdivide()
    label = label_smooth_faces(box.faces, box.face_normals, SMOOTH)
    for number in np.unique(label):
        assert np.ptp(box.face_normals[label == number], axis=0).max() < 1e-12


def test_no_triangle_has_no_number() -> None:
    assert label_smooth_faces(np.empty((0, 3), np.int64), np.empty((0, 3)), SMOOTH).shape == (0,)
