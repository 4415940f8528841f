"""Points sampled on a mesh lie on it, evenly."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.sampling import place_along, sample_by_area
from damageest.geometry.transforms import move_mesh
from tests.geometry.shapes import FAR, box, torus


@given(st.integers(0, 1000), st.integers(1, 3000))
@settings(max_examples=25, deadline=None)
def test_each_triangle_gets_its_share_of_the_points(seed: int, count: int) -> None:
    ring = torus()
    points, face = sample_by_area(ring, count, np.random.default_rng(seed))
    assert points.shape == (count, 3)
    assert distance_to_mesh(points, ring).max() < 1e-9
    share = count * np.linalg.norm(ring.cross, axis=1) / 2 / ring.area
    assert np.abs(np.bincount(face, minlength=len(ring.faces)) - share).max() < 2
    # each point lies in the triangle that is said to hold it
    corners = ring.triangles[face]
    height = np.einsum("ij,ij->i", points - corners[:, 0], ring.cross[face]) / np.linalg.norm(ring.cross[face], axis=1)
    assert np.abs(height).max() < 1e-9


def test_points_are_even_within_a_triangle() -> None:
    block = box((20, 10, 5))
    points, _ = sample_by_area(block, 40_000, np.random.default_rng(0))
    top = points[np.abs(points[:, 2] - 2.5) < 1e-9]
    assert top[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=0.15)
    assert top[:, :2].var(axis=0) == pytest.approx([20**2 / 12, 10**2 / 12], rel=0.03)


def test_the_same_seed_gives_the_same_points_and_only_chosen_triangles_get_some() -> None:
    block = box((20, 10, 5))
    first, again = (sample_by_area(block, 100, np.random.default_rng(7)) for _ in range(2))
    assert first[0].tobytes() == again[0].tobytes()
    assert sample_by_area(block, 100, np.random.default_rng(8))[0].tobytes() != first[0].tobytes()
    _, face = sample_by_area(block, 100, np.random.default_rng(7), np.array([3, 8]))
    assert set(face.tolist()) == {3, 8}


def test_far_from_the_origin_the_points_are_the_same() -> None:
    T = np.eye(4)
    T[:3, 3] = FAR
    near, far = (sample_by_area(mesh, 500, np.random.default_rng(1))[0] for mesh in (torus(), move_mesh(torus(), T)))
    assert np.abs(far - FAR - near).max() < 1e-8


@given(st.floats(0.05, 50.0))
def test_places_along_edges_are_even_and_hold_both_ends(step: float) -> None:
    block = box((20, 10, 5))
    edges = block.faces[:, :2]
    places = place_along(block.vertices, edges, step)
    start = 0
    for a, b in block.vertices[edges]:
        stop = start + int(np.ceil(np.linalg.norm(b - a) / step)) + 1
        own = places[start:stop]
        assert np.allclose(own[[0, -1]], [a, b])
        assert np.allclose(np.diff(own, axis=0), (b - a) / (len(own) - 1))
        assert np.linalg.norm(np.diff(own, axis=0), axis=1).max() <= step * (1 + 1e-9)
        start = stop
    assert start == len(places)
