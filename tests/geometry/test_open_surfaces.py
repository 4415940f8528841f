"""Before and after a reconstruction: points thinned and oriented, a mesh trimmed to them."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Part, Surface
from damageest.errors import StageError
from damageest.geometry.open_surfaces import (
    FEWEST,
    MOST_CELLS,
    centre_points,
    choose_cell,
    faces_skin,
    orient_points,
    take_largest_piece,
    thin_for_surface,
    trim_surface,
)
from damageest.geometry.sampling import sample_by_area
from tests.geometry.shapes import ball, box, join
from tests.stages._open import bowl

BLOCK = box((40, 30, 20))
PART = Part(BLOCK.vertices, BLOCK.faces)
PIT = bowl(6, 10, 0.3)
"""A pit of radius 6 in the top of the part, normals up."""


def test_too_few_points_are_refused_with_the_number_needed() -> None:
    points = np.random.default_rng(0).normal(size=(FEWEST, 3)) * 10
    assert centre_points(points) == pytest.approx(points.mean(axis=0))
    with pytest.raises(StageError, match="from 15 points; at least 16 are needed"):
        centre_points(points[1:])
    assert len(thin_for_surface(points, 0.1)) == FEWEST
    with pytest.raises(StageError, match="from 16 points, 1 after thinning; at least 16 are needed"):
        thin_for_surface(points, 1000)


def test_points_come_onto_the_surface_with_normals_toward_the_skin() -> None:
    rng = np.random.default_rng(0)
    points, _ = sample_by_area(PIT, 6000, rng)
    points = points + 0.05 * rng.normal(size=points.shape)
    cloud, normals = orient_points(points, PART, 0.8, 0.05)
    assert 100 < len(cloud) < len(points) / 4
    out = cloud - [0, 0, 10]
    radius = np.linalg.norm(out, axis=1)
    assert np.abs(radius - 6).max() < 0.15
    assert np.std(radius - 6) < 0.03
    assert (np.einsum("ij,ij->i", normals, -out / radius[:, None]) > 0.95).all()


@pytest.mark.variants(2)
@pytest.mark.parametrize("away", [0.0, 1e5])
@pytest.mark.parametrize("turned", [False, True])
def test_only_the_piece_at_the_points_inside_the_part_is_left(turned: bool, away: float) -> None:
    # a ball about the pit overshoots the part; a second one is far from all points
    vertices, faces = join(ball(6, (0, 0, 10), 4), ball(3, (-14, 0, 0)))
    cloud = PIT.vertices + away
    part = Part(PART.vertices + away, PART.faces)
    surface = trim_surface(vertices + away, faces[:, ::-1] if turned else faces, cloud, 1.0, part, 0.4)
    assert surface.vertices[:, 2].max() < 10.2 + away
    assert np.linalg.norm(surface.vertices - [away, away, 10 + away], axis=1) == pytest.approx(6, abs=1e-3)
    assert surface.area == pytest.approx(2 * np.pi * 36, rel=0.05)
    assert (np.einsum("ij,ij->i", surface.cross, [away, away, 10 + away] - surface.triangles.mean(axis=1)) > 0).all()


def test_nothing_near_the_points_is_refused() -> None:
    far = ball(3, (-14, 0, 0))
    for faces in (far.faces, far.faces[:0]):
        with pytest.raises(StageError, match="no inner damage surface"):
            trim_surface(far.vertices, faces, PIT.vertices, 1.0, PART, 0.4)


def test_the_largest_piece_is_a_manifold() -> None:
    large, small = PIT.faces, PIT.faces[:200] + len(PIT.vertices)
    assert np.array_equal(take_largest_piece(np.concatenate([small, large])), large)
    # two triangles that touch the rim of the first piece in one vertex
    rim = PIT.faces.max(initial=0) - 2
    touching = np.array([[rim, 9000, 9001], [9001, 9000, 9002]])
    assert np.array_equal(take_largest_piece(np.concatenate([large, touching])), large)
    # two fans of one surface that meet in a vertex: the triangles at it are removed
    left = take_largest_piece(np.delete(large, np.flatnonzero((large == 700).any(axis=1))[[0, 3]], axis=0))
    assert 700 not in left
    assert len(left) == len(large) - 6
    assert len(take_largest_piece(large[:0])) == 0


def test_a_surface_faces_the_skin_or_not() -> None:
    assert faces_skin(PIT, PART)
    assert not faces_skin(Surface(PIT.vertices, PIT.faces[:, ::-1]), PART)


def test_a_cell_follows_tolerance_and_spacing_and_bounds_their_number() -> None:
    size = np.array([10.0, 20.0, 5.0])
    assert choose_cell(size, 0.2, 0.1) == 0.2
    assert choose_cell(size, 0.2, 0.3) == 0.3
    assert choose_cell(size, 0.2, 0.3, 0.05) == 0.05
    coarse = choose_cell(100 * size, 0.2, 0.3)
    assert np.prod(100 * size / coarse) == pytest.approx(MOST_CELLS)
