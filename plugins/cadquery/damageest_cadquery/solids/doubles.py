"""Pieces of a damage volume that lie in others of it, all or in part: a CAD file can hold a solid twice, an assembly
and its parts fused, or solids that overlap. The mesh of the part has such metal once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from damageest.artefacts import Floats
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.joining import StockError, combine
from damageest_cadquery.solids.split import Origin, Piece, ShapeMap, measure_volume, note_images, triangulate

OUTSIDE = 0.02
"""Share of a piece that may lie outside the others, or in them: triangles of the same curved face differ."""
SLIVER = 1e-3
"""Share of a piece below which what is left of it is dropped."""
SHARED = -4
"""In origins: (number, SHARED) is a piece of a CAD face that lies in the metal of another solid."""


def leave_once(bodies: Sequence[Any]) -> list[Any]:
    """What is left of each of some Manifolds where larger ones have the metal that they share; None for those that lie
    in these. Of equal ones, the first is whole."""
    left: list[Any] = [None] * len(bodies)
    larger: Any = None
    for number in sorted(range(len(bodies)), key=lambda k: -bodies[k].volume()):
        body = bodies[number]
        outside = body if larger is None else body - larger
        share = outside.volume() / body.volume()
        if share >= OUTSIDE:
            left[number] = body if share > 1 - OUTSIDE else outside
            larger = body if larger is None else larger + body
    return left


def drop_doubles(pieces: Sequence[Piece], origin: Floats, chord: float) -> tuple[tuple[Piece, ...], tuple[Piece, ...]]:
    """The pieces that do not lie in others, without what larger ones have of them; and what does. Raises InputError or
    ValueError where the triangles of one do not close."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut

    from damageest.geometry.solids import to_manifold

    if len({piece.owner for piece in pieces}) < 2:
        return tuple(pieces), ()
    bodies = [to_manifold(triangulate(piece.shape, chord), origin) for piece in pieces]
    kept: list[Piece] = []
    doubles: list[Piece] = []
    for number, (piece, body, left) in enumerate(zip(pieces, bodies, leave_once(bodies), strict=True)):
        if left is None or left is body:
            (doubles if left is None else kept).append(piece)
            continue
        over = [
            pieces[k]
            for k, other in enumerate(bodies)
            if (other.volume(), -k) > (body.volume(), -number) and (other ^ body).volume() > 0
        ]
        kept += _combine(BRepAlgoAPI_Cut(), piece, over)
        doubles += _combine(BRepAlgoAPI_Common(), piece, over)
    return tuple(kept), tuple(doubles)


def _combine(algorithm: Any, piece: Piece, others: Sequence[Piece]) -> list[Piece]:
    """What a Boolean operation leaves of a piece. Faces in the metal of the others are those of their CAD faces."""
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID

    try:
        shape = combine(algorithm, [piece.shape], [other.shape for other in others])
    except StockError:
        return [piece]  # the check of the volume refuses it
    known = ShapeMap()
    for each in (piece, *others):
        for face, (number, kind) in zip(explore(each.shape, TopAbs_FACE), each.origins, strict=True):
            inside: Origin = (number, SHARED) if number >= 0 and each is not piece else (number, kind)
            note_images(known, algorithm, face, inside)
    least = SLIVER * measure_volume(piece.shape)
    solids = [solid for solid in explore(shape, TopAbs_SOLID) if measure_volume(solid) > least]
    return [
        Piece(solid, piece.owner, tuple(known.get(face, (-1, -1)) for face in explore(solid, TopAbs_FACE)))
        for solid in solids
    ]
