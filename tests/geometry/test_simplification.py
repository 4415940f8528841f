"""Fewer triangles within the limits: surface and volume are measured against what they were."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from damageest.artefacts import Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.simplification import simplify_within
from damageest.geometry.solids import to_solid
from tests.geometry.shapes import FAR, box, invert, join


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
def test_a_dented_block_loses_triangles_and_stays_within_the_detail(away: np.ndarray) -> None:
    dented = to_solid(Manifold.cube((20, 20, 20)) - Manifold.sphere(6, 256).translate((10, 10, 20)), away)
    assert dented is not None
    made = simplify_within(dented, 0.02)
    assert len(made.faces) < len(dented.faces) / 2
    assert made.volume == pytest.approx(dented.volume, rel=1e-3)
    assert distance_to_mesh(made.vertices, dented).max() <= 0.02
    assert distance_to_mesh(dented.vertices, made).max() <= 0.02


def divide(solid: Solid) -> Solid:
    """The same shape with 16 times as many triangles."""
    vertices, faces = solid.vertices, solid.faces
    for _ in range(2):
        vertices, faces = trimesh.remesh.subdivide(vertices, faces)[:2]
    return Solid(vertices, faces)


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
def test_flat_sides_need_two_triangles_and_cavity_and_second_body_stay(away: np.ndarray) -> None:
    parts = [divide(box(size, away + at)) for size, at in ((10, [0.0, 0, 0]), (6, [0.0, 0, 0]), (3, [30.0, 0, 0]))]
    made = simplify_within(Solid(*join(parts[0], invert(parts[1]), parts[2])), 0.1)
    assert len(made.faces) == 3 * 12
    assert [[shell.volume, *(cavity.volume for cavity in cavities)] for shell, cavities in split_shells(made)] == [
        pytest.approx([1000, 216]),
        pytest.approx([27]),
    ]


def test_what_has_no_triangle_to_spare_stays_as_it_is() -> None:
    made = simplify_within(box(10), 1.0)
    assert np.array_equal(made.vertices, box(10).vertices)
    assert np.array_equal(made.faces, box(10).faces)
