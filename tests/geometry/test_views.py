"""The direction that a damage is looked at from: it is seen from there, and the rest of the part is not in the way."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.views import DIRECTIONS, choose_view


def make_box(size: tuple[float, float, float], centre: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    mesh = trimesh.creation.box(size).subdivide().subdivide().subdivide()
    return Mesh(np.asarray(mesh.vertices) + np.array(centre), np.asarray(mesh.faces))


def take_side(box: Mesh, normal: np.ndarray) -> Mesh:
    """The faces of a box that face a direction."""
    return Mesh(box.vertices, box.faces[box.face_normals @ normal > 0.9])


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1, 1])
def test_a_side_is_seen_from_its_front(axis: int, sign: int) -> None:
    box, normal = make_box((4, 4, 4)), sign * np.eye(3)[axis]
    side = take_side(box, normal)
    view = choose_view(RayCaster(box), side, side.bounds, 4.0)
    assert view.direction @ normal > 0.5
    assert np.linalg.norm(view.direction) == pytest.approx(1)
    assert view.centre == pytest.approx(side.bounds.mean(axis=0))
    assert abs(view.up @ view.direction) < 0.99


def test_what_is_in_the_way_is_avoided() -> None:
    box = make_box((4, 4, 4))
    side = take_side(box, np.array([0.0, 0, 1]))
    roof = make_box((4, 40, 0.2), (-1.0, 0, 3))  # covers all but the side of +x
    left = Mesh(
        np.concatenate([box.vertices, roof.vertices]), np.concatenate([box.faces, roof.faces + len(box.vertices)])
    )
    view = choose_view(RayCaster(left), side, side.bounds, 4.0)
    assert view.direction[0] > 0


def test_without_faces_it_looks_from_above_at_the_bounds() -> None:
    box = make_box((4, 4, 4))
    nothing = Mesh(box.vertices, box.faces[:0])
    view = choose_view(RayCaster(box), nothing, box.bounds, 4.0)
    assert view.radius == pytest.approx(np.sqrt(12))
    assert view.direction[2] > 0
    assert any((view.direction == one).all() for one in DIRECTIONS)
