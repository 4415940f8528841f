"""Weights of places on triangles."""

from __future__ import annotations

import numpy as np

from damageest.geometry.barycentric import find_barycentric


def test_weights_give_the_place_back() -> None:
    rng = np.random.default_rng(0)
    corners, weights = rng.normal(size=(500, 3, 3)), rng.dirichlet([0.5] * 3, 500)
    weights[:3] = np.eye(3)
    places = np.einsum("nk,nki->ni", weights, corners)
    np.testing.assert_allclose(find_barycentric(corners, places), weights, atol=1e-6)


def test_places_beside_a_triangle_have_weights_beyond_it_unless_they_are_clipped() -> None:
    corners, place = np.eye(3)[None], np.array([[1.5, -0.5, 0.0]])
    np.testing.assert_allclose(find_barycentric(corners, place, clip=False), place)
    np.testing.assert_allclose(find_barycentric(corners, place), [[1.0, 0.0, 0.0]])
