"""Solids to manifold3d and back, their union, difference and overlap."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold3d import Manifold

from damageest.artefacts import Mesh, Part, Solid
from damageest.geometry.solids import (
    compose_shells,
    concatenate_meshes,
    iou,
    subtract_lost,
    to_arrays,
    to_manifold,
    to_solid,
    unite,
)
from tests.geometry.shapes import FAR, ball, box, torus


def test_there_and_back_far_from_the_origin_in_float64() -> None:
    brick = trimesh.creation.box((1, 2, 3))
    origin = np.array([1e7, -1e7, 5.0])
    body = to_manifold(Mesh(brick.vertices + origin, brick.faces), origin)
    assert body.volume() == pytest.approx(6, rel=1e-8)
    vertices, faces = to_arrays(body, origin)
    assert faces.dtype == np.int64
    assert np.allclose(np.unique(vertices, axis=0), np.unique(brick.vertices + origin, axis=0), atol=1e-8, rtol=0)


def test_an_open_mesh_is_refused() -> None:
    with pytest.raises(ValueError, match="rejects"):
        to_manifold(Mesh(box().vertices, box().faces[:-1]))


@pytest.mark.parametrize("turn", [0.0, 0.1, 0.7])
def test_what_is_left_and_what_is_lost_make_the_whole(turn: float) -> None:
    """The block taken off shares faces with the whole, whose corners are rounded off by the turn."""
    frame = trimesh.transformations.rotation_matrix(turn, (1, 2, 3))
    boxes = [trimesh.creation.box(bounds=b) for b in ([(0, 0, 0), (4, 3, 2)], [(3, 1, 0), (4, 3, 1)])]
    whole, lost = (to_manifold(Solid(made.apply_transform(frame).vertices, made.faces)) for made in boxes)
    assert subtract_lost(whole, lost).volume() == pytest.approx(24 - 2, rel=1e-7)


class Crooked:
    """A body whose plain difference is wrong by a third, as manifold3d's was seen to be."""

    def __init__(self, volume: float, error: float = 0.0) -> None:
        self._volume, self.error = volume, error

    def volume(self) -> float:
        return self._volume

    def bounding_box(self) -> tuple[float, ...]:
        return (0.0, 0.0, 0.0, 1.0, 1.0, 1.0)

    def __sub__(self, other: Crooked) -> Crooked:
        return Crooked(self._volume - other._volume * (1 - other.error))

    def __xor__(self, other: Crooked) -> Crooked:
        return Crooked(other._volume, other.error / 2)

    def translate(self, step: tuple[float, ...]) -> Crooked:
        return Crooked(self._volume, 0.0 if max(map(abs, step)) > 0 else self.error)


def test_a_difference_that_does_not_balance_is_made_another_way() -> None:
    assert subtract_lost(Crooked(10), Crooked(3, 1 / 3)).volume() == pytest.approx(7)


@given(st.lists(st.floats(0.1, 3), min_size=1, max_size=6), st.sampled_from([0.0, 1e5]))
@settings(max_examples=20, deadline=None)
def test_meshes_put_together_keep_their_volumes_and_owners(sizes: list[float], away: float) -> None:
    meshes = [ball(size, (away, 10.0 * k, 0), 1) for k, size in enumerate(sizes)]
    vertices, faces, owner = concatenate_meshes(meshes)
    assert Solid(vertices, faces).volume == pytest.approx(sum(mesh.volume for mesh in meshes))
    assert owner.tolist() == [k for k, mesh in enumerate(meshes) for _ in mesh.faces]
    for k, mesh in enumerate(meshes):
        assert np.array_equal(vertices[faces[owner == k]], mesh.triangles)


@given(st.floats(0, 2), st.sampled_from([0.0, 1e5]))
@settings(max_examples=20, deadline=None)
def test_overlap_and_union_of_shifted_cubes(shift: float, away: float) -> None:
    one, other = box(1, FAR * away / 1e5), box(1, FAR * away / 1e5 + [shift, 0, 0])
    common = max(0.0, 1 - shift)
    assert iou(one, other) == pytest.approx(common / (2 - common), abs=1e-9)
    assert iou(other, one) == pytest.approx(iou(one, other), abs=1e-12)
    origin = one.bounds.mean(axis=0)
    assert unite([one, other], origin).volume() == pytest.approx(2 - common, abs=1e-9)


def test_no_solid_is_equal_to_none_alone() -> None:
    assert iou(None, None) == 1
    assert iou(None, box()) == iou(box(), None) == 0
    assert unite([]).is_empty()
    assert to_solid(unite([])) is None


def test_a_manifold_comes_back_as_the_solid_where_it_was() -> None:
    ring = Mesh(torus().vertices + FAR, torus().faces)
    made = to_solid(to_manifold(ring, FAR), FAR)
    assert made is not None
    assert made.volume == pytest.approx(torus().volume)
    assert made.bounds == pytest.approx(ring.bounds, abs=1e-9)


def test_shells_are_put_together_with_their_cavities() -> None:
    ball_in_it = Manifold.cube((4, 4, 4)) - Manifold.sphere(1, 16).translate((2, 2, 2))
    body = ball_in_it + Manifold.cube((1, 1, 1)).translate((9, 0, 0))
    shells = body.decompose()
    assert sorted(np.sign([shell.volume() for shell in shells])) == [-1, 1, 1]
    assert compose_shells(shells).volume() == pytest.approx(body.volume(), rel=1e-12)
    assert compose_shells([]).is_empty()


def test_the_body_of_a_part_is_kept_for_its_origin_alone() -> None:
    cube = box(10.0)
    part = Part(cube.vertices, cube.faces)
    kept = to_manifold(part)
    assert to_manifold(part) is kept
    moved = to_manifold(part, (1.0, 0, 0))
    assert moved is not kept
    assert moved.bounding_box()[0] == pytest.approx(kept.bounding_box()[0] - 1)
    assert to_manifold(Part(2 * cube.vertices, cube.faces), (1.0, 0, 0)).volume() == pytest.approx(8000)
