"""Polygons divided into triangles: the area is theirs, and each edge of an outline is an edge of one triangle."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry.polygons import triangulate_polygons

OUTLINES = {
    "square": [(0, 0), (4, 0), (4, 4), (0, 4)],
    "dart": [(0, 0), (4, 4), (0, 1), (-4, 4)],
    "dart from its wing": [(4, 4), (0, 1), (-4, 4), (0, 0)],
    "step": [(0, 0), (6, 0), (6, 1), (1, 1), (1, 4), (0, 4)],
    "corner on an edge": [(0, 0), (2, 0), (4, 0), (4, 4), (0, 4)],
    "comb": [(0, 0), (9, 0), (9, 5), (8, 5), (8, 1), (6, 1), (6, 5), (5, 5), (5, 1), (3, 1), (3, 5), (0, 5)],
    "hole by a bridge": [(0, 0), (9, 0), (9, 9), (0, 9), (0, 0), (3, 3), (3, 6), (6, 6), (6, 3), (3, 3)],
}


def area_of(outline: np.ndarray) -> float:
    x, y = outline.T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


@pytest.mark.parametrize("name", OUTLINES)
@pytest.mark.parametrize("turned", [False, True])
def test_triangles_cover_a_polygon_once(name: str, turned: bool) -> None:
    flat = np.array(OUTLINES[name][:: -1 if turned else 1], float)
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    vertices = np.column_stack([flat, np.zeros(len(flat))]) @ turn.T + 1e3
    made = triangulate_polygons(vertices, np.arange(len(flat)), np.array([len(flat)]))
    cross = np.cross(*(vertices[made.faces[:, k]] - vertices[made.faces[:, 0]] for k in (1, 2))) / 2
    assert np.linalg.norm(cross, axis=1).sum() == pytest.approx(area_of(flat), rel=1e-9)
    assert np.linalg.norm(cross.sum(axis=0)) == pytest.approx(area_of(flat), rel=1e-9)  # and none is turned over
    edges = {(a, b) for face in made.faces.tolist() for a, b in zip(face, face[1:] + face[:1], strict=True)}
    assert {(k, (k + 1) % len(flat)) for k in range(len(flat))} <= edges
    assert len(made.faces) == len(flat) - 2


def test_faces_stay_in_their_order_and_a_fan_stays_one() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1.0]])
    made = triangulate_polygons(vertices, np.array([0, 1, 2, 3, 0, 1, 4, 2, 3]), np.array([4, 3, 2]))
    assert made.faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 4]]
    assert made.polygon.tolist() == [0, 0, 1]
    assert (made.divided, made.concave) == (1, 0)
