"""Which pieces of the part's solids, split by a cut, are the damage volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from damageest.artefacts import Solid
from damageest.errors import InputError
from damageest.geometry.bodies import split_bodies
from damageest.geometry.solids import to_manifold
from damageest_cadquery.cutting.check_pieces import INVALID
from damageest_cadquery.reading.read import find_box
from damageest_cadquery.solids.doubles import drop_doubles, leave_once
from damageest_cadquery.solids.split import (
    Piece,
    Tool,
    estimate_volume,
    is_near,
    is_opencascade_error,
    measure_volume,
    split,
    triangulate,
)

SPECK = 1e-3
"""Share of the damage volume below which a body of it, or a piece that a split leaves over, is dropped."""
DUST = 1e-5
"""Share of it below which a piece is nothing at all."""
MOST = 2.0
"""Damage volumes that a piece may have, by an estimate, that is looked at: whether it is one, its triangles tell."""


def count_bodies(damage: Solid, solids: Sequence[Piece], tolerance: float) -> int:
    """How many solids a damage volume is: in a part of several, which its mesh may have united, one or more in each."""
    least, origin = SPECK * damage.volume, damage.bounds.mean(axis=0)
    alone = sum(body.volume > least for body in split_bodies(damage))
    if len({piece.owner for piece in solids}) < 2:
        return alone
    lost, found = to_manifold(damage, origin), []
    for piece in solids:
        if not is_near(piece.shape, damage):
            continue
        try:
            common = to_manifold(triangulate(piece.shape, tolerance / 16), origin) ^ lost
        except (InputError, ValueError):
            return alone
        found += [body for body in common.decompose() if body.volume() > least]
    left = [each for each in leave_once(found) if each is not None]
    return sum(body.volume() > least for each in left for body in each.decompose())


@dataclass(frozen=True, eq=False)
class Taken:
    """``damage``: the pieces that are the damage volume; ``rest``: all others; ``doubles``: those that lie in other
    pieces of the damage volume; ``specks``: small ones of it, which are not counted as its solids."""

    damage: tuple[Piece, ...]
    rest: tuple[Piece, ...]
    doubles: tuple[Piece, ...]
    specks: tuple[Piece, ...]


def take_pieces(solids: Sequence[Piece], tool: Tool, fuzzy: float, damage: Solid, tolerance: float) -> Taken | str:
    """What a tool makes of solids; or why it does not cut the damage volume out."""
    from OCP.BRepCheck import BRepCheck_Analyzer

    why = "it does not separate the solid"
    taken: list[Piece] = []
    rest: list[Piece] = []
    specks: list[Piece] = []
    try:
        for solid in solids:
            if not _touch(solid.shape, tool.shape):
                rest.append(solid)
                continue
            made = split(solid.shape, solid.owner, solid.origins, tool, fuzzy)
            if made is None:
                return why
            for piece in made:
                share = estimate_volume(piece.shape) / damage.volume
                if share < 10 * SPECK:
                    share = measure_volume(piece.shape) / damage.volume
                may_be = SPECK < share < MOST
                if may_be and not BRepCheck_Analyzer(piece.shape).IsValid():
                    return INVALID  # to triangulate it can take minutes
                if may_be and _is_damage(piece, damage, tolerance):
                    taken.append(piece)
                elif share > SPECK:
                    rest.append(piece)
                elif share > DUST and _is_speck(piece, damage, tolerance):
                    specks.append(piece)
        kept, doubles = drop_doubles(taken, damage.bounds.mean(axis=0), tolerance / 16)
    except Exception as error:
        # of the others, a piece that cannot be triangulated, or whose triangles do not close
        if not (is_opencascade_error(error) or isinstance(error, (InputError, ValueError))):
            raise
        return why
    return Taken(kept, tuple(rest), doubles, tuple(specks)) if kept else why


def _is_speck(piece: Piece, damage: Solid, tolerance: float) -> bool:
    """Whether a small piece belongs to the damage volume; not where that cannot be told."""
    from OCP.BRepCheck import BRepCheck_Analyzer

    try:
        return BRepCheck_Analyzer(piece.shape).IsValid() and _is_damage(piece, damage, tolerance)
    except (InputError, ValueError):
        return False


def _is_damage(piece: Piece, damage: Solid, tolerance: float) -> bool:
    mesh = triangulate(piece.shape, tolerance / 16)
    origin = damage.bounds.mean(axis=0)
    common = to_manifold(mesh, origin) ^ to_manifold(damage, origin)
    return bool(common.volume() > 0.5 * mesh.volume)


def _touch(first: Any, second: Any) -> bool:
    return not find_box([first]).IsOut(find_box([second]))
