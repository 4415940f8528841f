"""Stock on the exact damage volume's own skin, as the stage `allowance: milling` builds it of triangles.

The exact damage volume ends on another outline than the mesh: the mesh rounds the rim, or draws it out where the loss
fades. On small damages that is more of the stock than the check of its volume allows. On one and the same skin the
offsets of CAD faces and the stage's own stock, which is made in another way, have to be the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Deposit, Flags, Floats, Ints, Mesh, Part, Solid
from damageest.errors import InputError
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.solids import to_manifold
from damageest.stages.allowance.plain import build_plain_stock
from damageest_cadquery._split import Piece
from damageest_cadquery._tessellate import Tessellation, tessellate

FINE = 1 / 32
"""Chord of triangles of the exact damage volume, in tolerances."""
FILM = 0.5
"""Thickness of a loss, in tolerances, below which its outline is not known: no surface is compared there either."""


class OwnSkin:
    """Triangles of an exact damage volume: ``whole`` (a mesh), its ``skin``, and the CAD face of each of its faces."""

    def __init__(self, pieces: Sequence[Piece], tolerance: float) -> None:
        found: Tessellation = tessellate([piece.shape for piece in pieces], FINE * tolerance, 20.0, lambda face: "")
        numbers = np.array([number for piece in pieces for number, _ in piece.origins])[found.faces_brep]
        self.whole = Solid(found.vertices, found.faces)
        self.numbers: Ints = numbers[numbers >= 0]
        self.skin = Mesh(found.vertices, found.faces[numbers >= 0])
        self.inner = Mesh(found.vertices, found.faces[numbers < 0])

    def build_stock(self, deposit: Deposit, metal: Any, tolerance: float) -> Any:
        """A Manifold about the middle of ``deposit``: the stage's stock of its heights by CAD face, without the damage
        volume and without ``metal``, a Manifold or None."""
        origin = deposit.bounds.mean(axis=0)
        stock = build_plain_stock(self.skin, _take_heights(dict(deposit.heights), self.numbers), origin, tolerance)
        stock = stock - to_manifold(self.whole, origin)
        return stock if metal is None else stock - metal


def is_plain(deposit: Deposit, lost: Solid, outside: Ints, part: Part, tolerance: float, most: float) -> bool:
    """Whether the mesh's stock is that of the heights on the CAD faces and nothing took any of it away, within a volume
    of ``most``: no region that is kept free, and no opposite wall. ``outside``: the faces of ``lost`` on the skin."""
    assert part.faces_brep is not None
    skin = Mesh(lost.vertices, lost.faces[outside])
    numbers = part.faces_brep[closest_on_mesh(skin.triangles.mean(axis=1), part)[1]]
    origin = deposit.bounds.mean(axis=0)
    stock = build_plain_stock(skin, _take_heights(dict(deposit.heights), numbers), origin, tolerance)
    return abs(float((stock - to_manifold(part, origin)).volume()) - deposit.stock_volume) <= most


def is_film(foot: Floats, inner: Mesh, tolerance: float) -> Flags:
    """Whether the loss below each place (N,3) on the skin is so thin that its outline is not known. ``inner``: the
    inner damage surface."""
    return distance_to_mesh(foot, inner) <= FILM * tolerance


def take_own_skin(pieces: Sequence[Piece], tolerance: float) -> OwnSkin | None:
    """None where the triangles of the exact damage volume do not close."""
    try:
        return OwnSkin(pieces, tolerance)
    except (InputError, ValueError):
        return None


def _take_heights(heights: Mapping[int, float], numbers: Ints) -> Floats:
    return np.array([max(heights.get(number, 0.0), 0.0) for number in numbers.tolist()])
