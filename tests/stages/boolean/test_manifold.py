"""Intersection of an enclosure with the part, against volumes known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold as Body

from damageest.artefacts import Part, Solid, open_edges
from damageest.errors import StageError
from damageest.geometry.solids import to_arrays
from damageest.stages.boolean.manifold import Manifold


def box(size: tuple[float, float, float], corner: tuple[float, float, float]) -> Solid:
    return Solid(*to_arrays(Body.cube(size).translate(corner)))


def part(corner: tuple[float, float, float] = (0, 0, 0)) -> Part:
    solid = box((10, 10, 10), corner)
    return Part(solid.vertices, solid.faces)


def test_an_overlap_has_the_volume_of_both() -> None:
    found = Manifold().run(box((4, 4, 4), (8, 8, 8)), part())
    assert found is not None
    assert found.volume == pytest.approx(8)
    assert open_edges(found.faces) == 0


def test_far_coordinates_cost_no_digits() -> None:
    far = 1e6
    found = Manifold().run(box((4, 4, 4), (far + 8, far + 8, far + 8)), part((far, far, far)))
    assert found is not None
    assert found.volume == pytest.approx(8, rel=1e-6)


def test_faces_on_the_part_stay_exactly_on_it() -> None:
    found = Manifold().run(box((4, 4, 4), (3, 3, 8)), part())
    assert found is not None
    assert (found.vertices[:, 2] == 10).sum() >= 4


def test_nothing_in_common_is_none() -> None:
    assert Manifold().run(box((1, 1, 1), (20, 0, 0)), part()) is None


def test_parts_of_an_enclosure_give_parts_of_a_damage() -> None:
    pair = Body.cube((2, 2, 4)).translate((1, 1, 8)) + Body.cube((2, 2, 4)).translate((6, 6, 8))
    found = Manifold().run(Solid(*to_arrays(pair)), part())
    assert found is not None
    assert found.volume == pytest.approx(16)


def test_a_mesh_that_manifold_refuses_is_a_stage_error() -> None:
    solid = box((4, 4, 4), (8, 8, 8))
    broken = object.__new__(Solid)
    object.__setattr__(broken, "vertices", solid.vertices)
    object.__setattr__(broken, "faces", np.ascontiguousarray(solid.faces[:-1]))
    with pytest.raises(StageError, match="manifold"):
        Manifold().run(broken, part())
