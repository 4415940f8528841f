"""Solids of one shape, wherever they lie."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Solid
from damageest.geometry.alike import have_same_shape, measure_radii
from tests.geometry.shapes import as_solid, ball, box, draw_pose


def place(solid: Solid, seed: int) -> Solid:
    T = draw_pose(np.random.default_rng(seed))
    return Solid(solid.vertices @ T[:3, :3].T + T[:3, 3], solid.faces)


@pytest.mark.parametrize("solid", [box((2, 5, 9)), ball(3.0), as_solid(trimesh.creation.cylinder(4, 12))])
def test_a_shape_is_the_same_in_any_pose(solid: Solid) -> None:
    assert have_same_shape(place(solid, 1), place(solid, 2))
    grown = Solid(1.05 * solid.vertices, solid.faces)
    assert not have_same_shape(solid, grown), "its volume is 16 % larger"


def test_the_same_volume_is_not_the_same_shape() -> None:
    assert not have_same_shape(box((2, 5, 9)), box((3, 5, 6)))


def test_radii_of_a_box() -> None:
    assert measure_radii(place(box((2, 5, 9)), 3)) == pytest.approx(np.array([2, 5, 9]) / np.sqrt(12))
