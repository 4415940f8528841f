"""Rays through meshes, against spheres and boxes whose crossings are known."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Floats, Mesh
from damageest.geometry.rays import RayCaster


@pytest.fixture(autouse=True, params=["embree", "libigl"])
def engine(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Embree, and what is asked where it has no wheel."""
    if request.param == "libigl":
        monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)


def ball(radius: float = 10.0, centre: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    sphere = trimesh.creation.icosphere(subdivisions=6, radius=radius)
    return Mesh(np.asarray(sphere.vertices) + centre, np.asarray(sphere.faces))


def cube(size: float = 2.0, centre: tuple[float, float, float] = (0, 0, 0)) -> Mesh:
    made = trimesh.creation.box((size,) * 3)
    return Mesh(np.asarray(made.vertices) + centre, np.asarray(made.faces))


def directions(count: int, seed: int = 0) -> Floats:
    out = np.random.default_rng(seed).normal(size=(count, 3))
    return np.asarray(out / np.linalg.norm(out, axis=1, keepdims=True))


@pytest.mark.variants(4)
@pytest.mark.parametrize("away", [20.0, 1e3, 1e6])
@pytest.mark.parametrize("centre", [(0, 0, 0), (5e5, -3e5, 1e5)])
def test_the_first_hit_on_a_sphere_is_the_analytic_one(away: float, centre: tuple[float, float, float]) -> None:
    """Also from far away, and for a mesh far from the origin."""
    toward = directions(2000)
    side = np.cross(toward, directions(2000, 1))
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    offset = np.random.default_rng(2).uniform(0, 9, 2000)
    origins = np.array(centre) - away * toward + offset[:, None] * side
    distance, face = RayCaster(ball(centre=centre)).find_first(origins, toward)
    assert (face >= 0).all()
    assert np.abs(distance - (away - np.sqrt(100 - offset**2))).max() < 0.02  # the sphere's facets: 0.003 deep
    beside, none = RayCaster(ball(centre=centre)).find_first(origins + 11 * side, toward)
    assert np.isinf(beside).all()
    assert (none == -1).all()


def test_the_face_that_is_hit_contains_the_point() -> None:
    mesh = ball()
    toward = directions(500)
    distance, face = RayCaster(mesh).find_first(-50 * toward, toward)
    points = -50 * toward + distance[:, None] * toward
    corner = mesh.triangles[face]
    height = np.einsum("ij,ij->i", points - corner[:, 0], mesh.cross[face])
    assert np.abs(height / np.linalg.norm(mesh.cross[face], axis=1)).max() < 1e-4
    assert np.linalg.norm(points - corner.mean(axis=1), axis=1).max() < 0.5


def test_rays_from_inside_hit_the_far_side() -> None:
    distance, _ = RayCaster(ball()).find_first(np.zeros((300, 3)), directions(300))
    assert np.abs(distance - 10).max() < 0.01


@pytest.mark.parametrize("away", [5.0, 1e4])
def test_a_segment_through_a_box_enters_and_leaves_it(away: float) -> None:
    rng = np.random.default_rng(0)
    foot = np.column_stack([np.zeros(200), rng.uniform(-0.9, 0.9, (200, 2))])
    along = np.array([1.0, 0, 0])
    found = RayCaster(cube()).find_crossings(foot - away * along, foot + away * along)
    assert np.array_equal(found.ray, np.repeat(np.arange(200), 2))
    assert found.distance.reshape(-1, 2) == pytest.approx(np.tile([away - 1, away + 1], (200, 1)), abs=1e-6 * away)
    assert found.enters.reshape(-1, 2).tolist() == [[True, False]] * 200


def test_a_segment_ends_where_it_ends() -> None:
    caster = RayCaster(cube())
    inside = caster.find_crossings(np.array([[-5.0, 0.3, 0.2]]), np.array([[0.0, 0.3, 0.2]]))
    assert inside.enters.tolist() == [True]
    out = caster.find_crossings(np.array([[0.0, 0.3, 0.2]]), np.array([[5.0, 0.3, 0.2]]))
    assert out.enters.tolist() == [False]
    short = caster.find_crossings(np.array([[-5.0, 0.3, 0.2]]), np.array([[-1.1, 0.3, 0.2]]))
    assert not len(short.ray)
    none = caster.find_crossings(np.empty((0, 3)), np.empty((0, 3)))
    assert not len(none.ray)


def test_crossings_of_random_segments_with_a_sphere() -> None:
    """Both ends anywhere: the number of crossings and their places follow from the quadratic equation."""
    rng = np.random.default_rng(3)
    origins, ends = rng.uniform(-20, 20, (2, 3000, 3))
    way = ends - origins
    length = np.linalg.norm(way, axis=1)
    way /= length[:, None]
    middle = -np.einsum("ij,ij->i", origins, way)
    square = 100 - (np.einsum("ij,ij->i", origins, origins) - middle**2)
    clear = np.abs(square) > 1  # without grazing rays
    half = np.sqrt(np.maximum(square, 0))
    clear &= np.minimum(np.abs(np.linalg.norm(origins, axis=1) - 10), np.abs(np.linalg.norm(ends, axis=1) - 10)) > 0.02
    found = RayCaster(ball()).find_crossings(origins, ends)
    for sign, enters in ((-1, True), (1, False)):
        at = middle + sign * half
        wanted = clear & (square > 0) & (at > 0) & (at < length)
        got = clear[found.ray] & (found.enters == enters)
        assert np.array_equal(found.ray[got], np.flatnonzero(wanted))
        assert np.abs(found.distance[got] - at[wanted]).max() < 0.03


def test_nested_shells_are_crossed_in_order() -> None:
    """A hollow box: in through the outer wall, out into the cavity, in again, out."""
    outer, inner = cube(4.0), cube(2.0)
    hollow = Mesh(
        np.concatenate([outer.vertices, inner.vertices]),
        np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
    )
    found = RayCaster(hollow).find_crossings(np.array([[-9.0, 0.1, 0.2]]), np.array([[9.0, 0.1, 0.2]]))
    assert found.distance == pytest.approx([7, 8, 10, 11], abs=1e-5)
    assert found.enters.tolist() == [True, False, True, False]
