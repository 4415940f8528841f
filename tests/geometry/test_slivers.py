"""Slivers between bodies that touch are no bodies and no cavities; real ones stay."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Solid
from damageest.geometry.bodies import label_pieces, split_bodies, split_shells
from damageest.geometry.make_part import make_part
from damageest.geometry.slivers import find_slivers
from damageest.geometry.solids import concatenate_meshes, to_solid

SIDES = 64
ERROR = 4 * (1 - np.cos(np.pi / SIDES))
"""What a chord of the bore cuts off."""


def take(body: Manifold) -> Solid:
    made = to_solid(body)
    assert made is not None
    return made


def rivet_a_block(bore: float) -> tuple[Solid, Solid]:
    """A block with a bore, and a rivet of radius 4 in it whose chords lie half a step beside those of the bore."""
    block = Manifold.cube((20, 20, 10), True) - Manifold.cylinder(30, bore, bore, SIDES, True)
    pin = Manifold.cylinder(10, 4, 4, SIDES, True).rotate((0, 0, 180 / SIDES))
    heads = [Manifold.cylinder(2, 6, 6, SIDES, True).translate((0, 0, z)) for z in (-6, 6)]
    return take(block), take(pin + heads[0] + heads[1])


def test_a_pin_in_its_bore_leaves_no_gaps_and_keeps_the_numbers_of_its_faces() -> None:
    pair = rivet_a_block(4.0)
    vertices, faces, owner = concatenate_meshes(pair)
    part = make_part(vertices, faces, tessellation_error=ERROR, faces_brep=owner, face_kinds=("plane", "cylinder"))
    assert len(split_shells(part)) == 1
    assert label_pieces(part.faces).max() == 0, "one shell, without cavities"
    assert any(f"dropped {SIDES} slivers" in note for note in part.notes)
    assert part.volume == pytest.approx(20 * 20 * 10 + 2 * 2 * pair[1].bounds[1, 0] ** 2 * np.pi, rel=1e-3)
    assert part.faces_brep is not None
    outside = np.abs(part.triangles[..., 2]).max(axis=1) > 5 + 1e-9
    np.testing.assert_array_equal(part.faces_brep, outside.astype(int))


def test_a_room_between_bodies_stays() -> None:
    vertices, faces, _ = concatenate_meshes(rivet_a_block(5.0))
    part = make_part(vertices, faces, tessellation_error=ERROR)
    ((_, cavities),) = split_shells(part)
    assert len(cavities) == 1
    assert cavities[0].volume == pytest.approx(np.pi * (25 - 16) * 10, rel=5e-3)


@pytest.mark.parametrize("height", [0.0, 1e-12, -1e-12, 1e-10])
def test_pieces_without_thickness_are_no_bodies(height: float) -> None:
    cube = take(Manifold.cube((10, 10, 10)))
    flat = np.array([[20, 0, 0], [23, 0, 0], [20, 4, 0], [21, 1, height]])
    around = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]) + len(cube.vertices)
    both = Solid(np.concatenate([cube.vertices, flat]), np.concatenate([cube.faces, around]))
    np.testing.assert_array_equal(find_slivers(both.vertices, both.faces), np.arange(16) >= 12)
    assert [len(body.faces) for body in split_bodies(both)] == [12]
    assert [(len(outer.faces), inner) for outer, inner in split_shells(both)] == [(12, [])]


def test_no_faces_have_no_slivers() -> None:
    assert find_slivers(np.empty((0, 3)), np.empty((0, 3), np.int64)).shape == (0,)
