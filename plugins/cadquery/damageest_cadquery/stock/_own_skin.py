"""Stock on the exact damage volume's own skin, as the stage `allowance: milling` builds it of triangles.

The exact damage volume ends on another outline than the mesh: the mesh rounds the rim, or draws it out where the loss
fades. On small damages that is more of the stock than what is allowed between stock and the mesh's. But on one and the
same skin, the offsets of CAD faces and the stage's own stock, which is made in another way, have to be the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Deposit, Floats, Ints, Mesh, Part, Solid
from damageest.errors import InputError
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.solids import to_manifold
from damageest.stages.allowance.plain_stock import build_plain_stock
from damageest_cadquery.reading.tessellate import tessellate
from damageest_cadquery.solids.doubles import SHARED
from damageest_cadquery.solids.split import Piece

FINE, ANGLE = 1 / 16, 30.0
"""Chord, in tolerances, and angle in degrees of triangles of the exact damage volume."""


def build_own_stock(damage: Sequence[Piece], deposit: Deposit, metal: Any, tolerance: float) -> Any:
    """A Manifold about the middle of ``deposit``: the stage's stock, with the heights of that by CAD face, on an exact
    ``damage`` volume; without this, and without ``metal``, a Manifold or None. None where its triangles do not close.
    """
    try:
        found = tessellate([piece.shape for piece in damage], FINE * tolerance, ANGLE, lambda face: "")
        whole = to_manifold(Solid(found.vertices, found.faces), deposit.bounds.mean(axis=0))
    except (InputError, ValueError):
        return None
    numbers = np.array([-1 if kind == SHARED else number for piece in damage for number, kind in piece.origins])
    numbers = numbers[found.faces_brep]
    skin = Mesh(found.vertices, found.faces[numbers >= 0])
    stock = _build(skin, dict(deposit.heights), numbers[numbers >= 0], deposit, tolerance) - whole
    return stock if metal is None else stock - metal


def is_plain(deposit: Deposit, lost: Solid, outside: Ints, part: Part, tolerance: float, most: float) -> bool:
    """Whether the mesh's stock is that of its heights by CAD face and nothing took any of it away, as a region to keep
    free or an opposite wall does, within a volume of ``most``. ``outside``: the faces of ``lost`` on the skin."""
    assert part.faces_brep is not None
    skin = Mesh(lost.vertices, lost.faces[outside])
    numbers = part.faces_brep[closest_on_mesh(skin.triangles.mean(axis=1), part)[1]]
    stock = _build(skin, dict(deposit.heights), numbers, deposit, tolerance)
    stock = stock - to_manifold(part, deposit.bounds.mean(axis=0))
    return abs(float(stock.volume()) - deposit.stock_volume) <= most


def _build(skin: Mesh, heights: Mapping[int, float], numbers: Ints, deposit: Deposit, tolerance: float) -> Any:
    """``numbers`` (F,): the CAD face of each face of the skin."""
    own: Floats = np.array([max(heights.get(number, 0.0), 0.0) for number in numbers.tolist()])
    return build_plain_stock(skin, own, deposit.bounds.mean(axis=0), tolerance)
