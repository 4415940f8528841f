"""Solids that touch themselves stay closed when a reader merges vertices."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from damageest.artefacts import Solid, open_edges
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.geometry.touching import merge_close, separate_sheets, separate_touching

RADIUS, GAP = 1e-6, 1e-5


def cube(*low: float) -> Any:
    return Manifold.cube((1, 1, 1)).translate(low)


def stacked(*bodies: Any) -> Solid:
    """Bodies as one mesh, without a Boolean."""
    arrays = [to_arrays(body) for body in bodies]
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in arrays)])
    return Solid(
        np.concatenate([vertices for vertices, _ in arrays]),
        np.concatenate([faces + start for (_, faces), start in zip(arrays, starts, strict=False)]),
    )


TOUCHING = {
    "along an edge": stacked(cube(0, 0, 0), cube(1, 1, 0)),
    "along an edge, nearly": stacked(cube(0, 0, 0), cube(1 + 3e-7, 1 - 2e-7, 1e-8)),
    "at a corner": stacked(cube(0, 0, 0), cube(1, 1, 1)),
    "on a face": stacked(cube(0, 0, 0), cube(1, 0, 0)),
    "on a face with a hairline between": stacked(cube(0, 0, 0), cube(1 + 3e-7, 0, 0)),
    "two on the edges of a third": stacked(cube(0, 0, 0), cube(1, 1, 0), cube(-1, 1, 0)),
    "a void on the outer edge": stacked(Manifold.cube((3, 3, 3)) - cube(1, 1, 1), cube(3, 3, 1)),
}


@pytest.mark.parametrize("name", TOUCHING)
def test_it_is_closed_when_vertices_are_merged(name: str) -> None:
    body = TOUCHING[name]
    found = separate_touching(body, RADIUS, GAP)
    assert found is not None
    assert open_edges(merge_close(found.vertices, found.faces, RADIUS)[1]) == 0
    assert found.volume == pytest.approx(body.volume, rel=1e-4)
    low, high = found.bounds - body.bounds
    assert np.abs([low, high]).max() <= 10 * GAP
    mesh = trimesh.Trimesh(found.vertices.astype(np.float32), found.faces)
    mesh.merge_vertices(digits_vertex=6)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(body.volume, rel=1e-4)


@pytest.mark.parametrize("seed", range(8))
def test_random_bodies_that_touch(seed: int) -> None:
    """Cubes at places of a grid touch at faces, edges and corners; each pair as a solid of its own."""
    rng = np.random.default_rng([7, seed])
    places = rng.integers(0, 3, (9, 3))
    turn = tuple(rng.uniform(0, 360, 3))
    body = stacked(*(cube(*place).rotate(turn) for place in np.unique(places, axis=0)))
    found = separate_touching(body, RADIUS, GAP)
    assert found is not None
    assert open_edges(merge_close(found.vertices, found.faces, RADIUS)[1]) == 0
    assert found.volume == pytest.approx(body.volume, rel=1e-4)


def test_a_solid_that_does_not_touch_itself_is_not_changed() -> None:
    body = Solid(*to_arrays(Manifold.sphere(3, 40)))
    found = separate_touching(body, RADIUS, GAP)
    assert found is not None
    assert np.array_equal(found.vertices, body.vertices)
    assert np.array_equal(found.faces, body.faces)


def test_sheets_of_a_boolean() -> None:
    body = (to_manifold(TOUCHING["along an edge"]) + cube(0, 1, 1)).scale((30, 30, 30))
    found = separate_sheets(body, np.array([500.0, 0, 0]), 0.1)
    assert found is not None
    single = found.vertices.astype(np.float32).astype(float)
    assert open_edges(merge_close(single, found.faces, 0.0)[1]) == 0
    assert separate_sheets(Manifold(), np.zeros(3), 0.1) is None
