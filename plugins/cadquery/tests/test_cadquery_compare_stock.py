"""Exact stock and the mesh's: which skin carries stock."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
from damageest_cadquery.stock._compare import _leave_touching
from manifold3d import Manifold

from damageest.artefacts import Part, Solid
from damageest.geometry.solids import to_arrays

TOLERANCE = 0.2


def take_solid(body: Any) -> Solid:
    return Solid(*to_arrays(body))


def test_skin_that_touches_another_solid_carries_no_stock() -> None:
    """A pin stands on a plate, as two solids; what is lost of the plate reaches under it."""
    plate, pin = (take_solid(Manifold.cube((20, 20, 5)).translate((-10, -10, -5))), Manifold.cube((4, 4, 6)))
    stand = take_solid(pin)
    both = Solid(
        np.concatenate([plate.vertices, stand.vertices]),
        np.concatenate([plate.faces, stand.faces + len(plate.vertices)]),
    )
    lost = take_solid(Manifold.cube((8, 8, 2)).translate((-4, -4, -2)).refine(8))
    top = np.flatnonzero(lost.face_normals[:, 2] > 0.9)
    under = ((lost.triangles[top].mean(axis=1)[:, :2] > 0) & (lost.triangles[top].mean(axis=1)[:, :2] < 4)).all(axis=1)
    kept = _leave_touching(lost, top, cast(Part, both), TOLERANCE)
    assert 0 < under.sum() < len(top)
    assert (kept == top[~under]).all()
    assert (_leave_touching(lost, top, cast(Part, plate), TOLERANCE) == top).all()
