"""Pieces of a damage volume that lie in others of it: a CAD file can hold a solid twice, or an assembly and its parts
fused. The mesh of the part has such metal once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from damageest.artefacts import Floats
from damageest_cadquery._split import Piece, triangulate

OUTSIDE = 0.02
"""Share of a piece that may lie outside the others: triangles of the same curved face differ."""


def find_doubles(bodies: Sequence[Any]) -> list[bool]:
    """Which of some Manifolds lie in the union of larger ones. Of equal ones, the first is none."""
    doubles = [False] * len(bodies)
    larger: Any = None
    for number in sorted(range(len(bodies)), key=lambda k: -bodies[k].volume()):
        body = bodies[number]
        if larger is None:
            larger = body
        elif (body - larger).volume() < OUTSIDE * body.volume():
            doubles[number] = True
        else:
            larger = larger + body
    return doubles


def drop_doubles(pieces: Sequence[Piece], origin: Floats, chord: float) -> tuple[tuple[Piece, ...], tuple[Piece, ...]]:
    """The pieces that do not lie in others, and those that do. Raises InputError or ValueError where the triangles of
    one do not close."""
    from damageest.geometry.solids import to_manifold

    if len({piece.owner for piece in pieces}) < 2:
        return tuple(pieces), ()
    doubles = find_doubles([to_manifold(triangulate(piece.shape, chord), origin) for piece in pieces])
    kept = tuple(piece for piece, double in zip(pieces, doubles, strict=True) if not double)
    return kept, tuple(piece for piece, double in zip(pieces, doubles, strict=True) if double)
