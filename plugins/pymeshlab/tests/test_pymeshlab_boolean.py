"""Intersection by PyMeshLab, against volumes known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_pymeshlab.boolean import PyMeshLabBoolean
from manifold3d import Manifold as Body

from damageest.artefacts import Part, Solid, open_edges
from damageest.errors import StageError
from damageest.geometry.solids import to_arrays
from damageest.stages.boolean.manifold import Manifold
from tests.needs import needs_plugin

pytestmark = needs_plugin("pymeshlab")


def solid(body: Body) -> Solid:
    return Solid(*to_arrays(body))


def part(body: Body) -> Part:
    return Part(*to_arrays(body))


CUBE = Body.cube((10, 10, 10))


def test_an_overlap_has_the_volume_of_both() -> None:
    found = PyMeshLabBoolean().run(solid(Body.cube((4, 4, 4)).translate((8, 8, 8))), part(CUBE))
    assert found is not None
    assert found.volume == pytest.approx(8, rel=1e-12)
    assert open_edges(found.faces) == 0


def test_far_coordinates_cost_no_digits() -> None:
    far = (1e6, 1e6, 1e6)
    found = PyMeshLabBoolean().run(
        solid(Body.cube((4, 4, 4)).translate((8, 8, 8)).translate(far)), part(CUBE.translate(far))
    )
    assert found is not None
    assert found.volume == pytest.approx(8, rel=1e-9)


def test_corners_are_kept_in_double_precision() -> None:
    third = 10 - 1 / 3
    found = PyMeshLabBoolean().run(solid(Body.cube((1, 1, 1)).translate((third, third, third))), part(CUBE))
    assert found is not None
    assert np.abs(found.bounds - np.array([[third], [10]])).max() < 1e-13


def test_agrees_with_manifold_on_curved_solids() -> None:
    ball, other = Body.sphere(5, 64), Body.sphere(4, 48).translate((3.3, 1.7, 0.9))
    found, expected = PyMeshLabBoolean().run(solid(other), part(ball)), Manifold().run(solid(other), part(ball))
    assert found is not None
    assert expected is not None
    assert found.volume == pytest.approx(expected.volume, rel=1e-9)


@pytest.mark.parametrize("x", [20.0, 10.0])
def test_nothing_in_common_is_none(x: float) -> None:
    assert PyMeshLabBoolean().run(solid(Body.cube((1, 1, 1)).translate((x, 0, 0))), part(CUBE)) is None


def test_parts_of_an_enclosure_give_parts_of_a_damage() -> None:
    pair = Body.cube((2, 2, 4)).translate((1, 1, 8)) + Body.cube((2, 2, 4)).translate((6, 6, 8))
    found = PyMeshLabBoolean().run(solid(pair), part(CUBE))
    assert found is not None
    assert found.volume == pytest.approx(16)


def test_same_meshes_same_bytes() -> None:
    ball = solid(Body.sphere(4, 48).translate((10, 5, 5)))
    made = [PyMeshLabBoolean().run(ball, part(CUBE)) for _ in range(4)]
    assert len({(found.vertices.tobytes(), found.faces.tobytes()) for found in made if found}) == 1


def test_solids_that_meet_in_an_edge_give_no_solid_and_are_refused() -> None:
    pair = Body.cube((2, 2, 2)).translate((1, 1, 7)) + Body.cube((2, 2, 2)).translate((3, 3, 7))
    with pytest.raises(StageError, match="not watertight") as caught:
        PyMeshLabBoolean().run(solid(pair), part(CUBE))
    assert "manifold" in caught.value.remedy


def test_an_open_mesh_is_a_stage_error() -> None:
    whole = solid(Body.cube((4, 4, 4)).translate((8, 8, 8)))
    broken = object.__new__(Solid)
    object.__setattr__(broken, "vertices", whole.vertices)
    object.__setattr__(broken, "faces", np.ascontiguousarray(whole.faces[:-1]))
    with pytest.raises(StageError, match="could not intersect") as caught:
        PyMeshLabBoolean().run(broken, part(CUBE))
    assert caught.value.remedy
