"""Triangles of known shapes are recognised, wherever they lie; others are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Floats
from damageest.geometry.shapes import recognise_shape

PLACE = trimesh.transformations.rotation_matrix(1.1, [1, 2, 3])
PLACE[:3, 3] = [40.0, -7.0, 300.0]


def place(mesh: trimesh.Trimesh) -> Floats:
    mesh = mesh.copy()
    mesh.apply_transform(PLACE)
    return np.asarray(mesh.triangles)


def take_side(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Without the ends across z."""
    return mesh.submesh([np.flatnonzero(np.abs(mesh.face_normals[:, 2]) < 0.99)], append=True)


def make(kind: str, size: float) -> trimesh.Trimesh:
    if kind == "plane":
        box = trimesh.creation.box((size, 2 * size, size))
        return box.submesh([np.flatnonzero(box.face_normals[:, 2] > 0.9)], append=True)
    if kind == "cylinder":
        return take_side(trimesh.creation.cylinder(size, 3 * size, sections=96))
    if kind == "cone":
        return take_side(trimesh.creation.cone(size, 3 * size, sections=96))
    return trimesh.creation.icosphere(subdivisions=4, radius=size)


@pytest.mark.parametrize("kind", ["plane", "cylinder", "cone", "sphere"])
@settings(max_examples=10, deadline=None)
@given(size=st.floats(0.01, 1000.0))
def test_a_shape_is_recognised_wherever_it_lies(kind: str, size: float) -> None:
    triangles = place(make(kind, size))
    found = recognise_shape(triangles)
    assert found is not None
    assert found.kind == kind
    assert found.sign == 1
    if found.has_radius:
        assert found.size == pytest.approx(size, rel=1e-3)
    if kind == "cone":
        assert found.size == pytest.approx(np.arctan(1 / 3), abs=1e-3)
    distance = found.measure(triangles.reshape(-1, 3))[0]
    assert np.abs(distance).max() < 2e-3 * np.ptp(triangles.reshape(-1, 3), axis=0).max()
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    outward = found.measure(triangles.mean(axis=1))[1]
    assert (np.einsum("ij,ij->i", outward, normals) > 0).all()


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_a_hole_has_its_outside_toward_the_axis(kind: str) -> None:
    triangles = place(make(kind, 4.0))[:, ::-1]
    found = recognise_shape(triangles)
    assert found is not None
    assert (found.kind, found.sign) == (kind, -1)
    middle = triangles.reshape(-1, 3).mean(axis=0)
    assert found.measure(middle[None])[0][0] > 0  # in the air


def test_what_lies_on_no_shape_is_none() -> None:
    rng = np.random.default_rng(1)
    torus = trimesh.creation.torus(10.0, 3.0)
    assert recognise_shape(np.asarray(torus.triangles)) is None
    assert recognise_shape(rng.normal(size=(50, 3, 3))) is None
    assert recognise_shape(np.empty((0, 3, 3))) is None
    assert recognise_shape(np.zeros((3, 3, 3))) is None


def test_halves_of_a_bore_are_one_shape_and_two_bores_are_not() -> None:
    side = make("cylinder", 5.0)
    left = side.triangles_center[:, 0] < 0
    first, second = (recognise_shape(np.asarray(side.triangles[half])) for half in (left, ~left))
    assert first is not None
    assert second is not None
    assert first.is_same(second, 0.01)
    moved = replace(second, point=second.point + np.array([1.0, 0.0, 0.0]))
    assert not first.is_same(moved, 0.01)


def test_slopes_are_those_of_small_motions() -> None:
    points = np.random.default_rng(2).normal(size=(30, 3)) * 5
    for kind in ("plane", "cylinder", "cone", "sphere"):
        shape = recognise_shape(np.asarray(make(kind, 4.0).triangles))
        assert shape is not None
        motion = 1e-6 * np.array([1.0, -2.0, 0.5, 3.0, 1.0, -1.0])
        moved = points + np.cross(motion[:3], points) + motion[3:]
        change = shape.measure(moved)[0] - shape.measure(points)[0]
        assert np.allclose(change, shape.find_slopes(points) @ motion, atol=1e-9)
