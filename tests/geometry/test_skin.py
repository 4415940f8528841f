"""Which faces of a damage volume lie on the skin of the part, and which inside the part."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Part
from damageest.geometry.skin import extract_ids, find_inner_faces, take_inner_surface, take_lost_skin
from damageest.geometry.solids import to_manifold, to_solid
from tests.geometry.shapes import FAR, box


def test_the_damage_surface_is_what_lies_inside_the_part_and_faces_the_loss() -> None:
    part = box((30, 20, 12))
    damage = to_solid(to_manifold(part) ^ Manifold.sphere(4, 96).translate((3, 2, 8)))
    assert damage is not None
    surface = extract_ids(damage, Part(part.vertices, part.faces))
    # a cap of a sphere of radius 4, 2 deep: 2 pi r h
    assert surface.area == pytest.approx(2 * np.pi * 4 * 2, rel=0.01)
    toward = np.array([3, 2, 8]) - surface.triangles.mean(axis=1)
    assert (np.einsum("ij,ij->i", surface.cross, toward) > 0).all()


def test_a_damage_that_is_all_skin_has_no_damage_surface() -> None:
    whole = box()
    assert len(extract_ids(whole, Part(whole.vertices, whole.faces)).faces) == 0


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
def test_faces_that_touch_the_skin_along_an_edge_are_inside(away: np.ndarray) -> None:
    part, corner = box(10, away), box(4, np.add(away, 3))
    inner = find_inner_faces(corner, Part(part.vertices, part.faces))
    # three sides of the corner lie on the skin, three inside
    assert np.array_equal(inner, corner.cross.sum(axis=1) < 0)
    assert extract_ids(corner, Part(part.vertices, part.faces)).area == pytest.approx(3 * 16)


def test_the_two_sides_of_a_damage_are_taken_once() -> None:
    part, corner = box(10), box(4, np.array([3.0, 3.0, 3.0]))
    inner = find_inner_faces(corner, Part(part.vertices, part.faces))
    skin, floor = take_lost_skin(corner, inner), take_inner_surface(corner, inner)
    assert skin.area == floor.area == pytest.approx(3 * 16)
    assert take_lost_skin(corner, inner) is skin
    assert take_inner_surface(corner, inner) is floor
    assert take_lost_skin(corner, ~inner).area == pytest.approx(3 * 16)
    assert np.array_equal(take_lost_skin(corner, ~inner).faces, floor.faces), "what tells them apart may be another"


def test_what_was_found_for_one_part_is_not_taken_for_another() -> None:
    corner = box(4, np.full(3, 3.0))
    small, large = box(10), box(40)
    assert find_inner_faces(corner, Part(small.vertices, small.faces)).sum() == 6
    part = Part(large.vertices, large.faces)
    assert find_inner_faces(corner, part).all()
    assert find_inner_faces(corner, part) is find_inner_faces(corner, part)
