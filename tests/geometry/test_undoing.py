"""Places and meshes moved back by the inverse of a field."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import DisplacementField, Floats, Mesh, Solid
from damageest.artefacts.displacement import fit_displacement
from damageest.geometry.undoing import count_crossings, cut_to_follow, undo

LOW, HIGH = np.array([-10.0, -5, -2]), np.array([10.0, 5, 2])


def make_field(amount: float = 0.3) -> DisplacementField:
    return DisplacementField(LOW, HIGH, amount * np.random.default_rng(0).normal(size=(6, 5, 4, 3)))


def bend(points: Floats) -> Floats:
    return np.asarray(points[:, :1] ** 2 * [0.0, 0.0, 0.02])


def test_places_are_found_that_the_field_moves_to_the_points() -> None:
    field = make_field()
    places = np.random.default_rng(1).uniform(LOW, HIGH, (500, 3))
    assert np.abs(undo(field, field.move(places)) - places).max() < 1e-8


def test_far_away_the_field_goes_on_without_growing() -> None:
    points = np.array([[500.0, 0, 0], [0, -300, 20]])
    assert np.linalg.norm(undo(make_field(0.1), points) - points, axis=1).max() < 3


@pytest.mark.slow
def test_a_field_that_folds_has_no_inverse() -> None:
    places = np.random.default_rng(1).uniform(LOW, HIGH, (500, 3))
    with pytest.raises(ArithmeticError, match="folds"):
        undo(make_field(8.0), places)


@pytest.mark.parametrize("within", [0.1, 0.01])
def test_triangles_follow_and_the_mesh_stays_closed(within: float) -> None:
    field = fit_displacement(bend, LOW, HIGH, (0, 0, 0))
    box = trimesh.creation.box(HIGH - LOW)
    vertices, faces = cut_to_follow(Mesh(box.vertices, box.faces), field.move, within)
    solid = Solid(vertices, faces)
    assert len(faces) > len(box.faces)
    some = np.random.default_rng(2).dirichlet([1, 1, 1], 50)
    above = (vertices[:, 2] - bend(vertices)[:, 2] > 2 - 1e-9)[faces].all(axis=1)
    top = np.einsum("sc,fcj->fsj", some, solid.triangles[above]).reshape(-1, 3)
    assert np.abs(top[:, 2] - bend(top)[:, 2] - 2).max() < 2 * within
    assert count_crossings(solid) == 0


def test_a_mesh_through_itself_is_seen() -> None:
    first, second = trimesh.creation.icosphere(2, 3.0), trimesh.creation.icosphere(2, 3.0)
    for apart, crosses in ((2.1, True), (6.5, False)):
        vertices = np.concatenate([first.vertices, second.vertices + np.array([apart, 0.1, 0.2])])
        mesh = Mesh(vertices, np.concatenate([first.faces, second.faces + len(first.vertices)]))
        assert (count_crossings(mesh) > 0) == crosses
