"""What is left of a CAD solid where a site has no exact form: facets on this solid alone, so that the others keep their
faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from damageest.artefacts import Part, Solid
from damageest.errors import InputError
from damageest.geometry.bodies import split_bodies
from damageest.geometry.skin import find_inner_faces
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.vectors import normalise
from damageest_cadquery.cutting._pieces import SPECK
from damageest_cadquery.cutting.check_pieces import VOLUME
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.planar import build_solid
from damageest_cadquery.solids.split import Piece, is_near, triangulate

FACET = -3
"""In origins: (-1, FACET) is a facet that stands for CAD faces."""


def cut_facets(rest: Sequence[Piece], damage: Solid, part: Part, tolerance: float) -> list[Piece] | None:
    """The pieces without a damage volume, in millimetres; those that it touches have facets, the others stay.

    None where the facets do not close, or have another volume than what was and what was lost.
    """
    chord, origin = tolerance / 8, damage.bounds.mean(axis=0)
    lost, cutter = to_manifold(damage, origin), to_manifold(_thicken(damage, part, tolerance / 2), origin)
    pieces: list[Piece] = []
    for piece in rest:
        if not is_near(piece.shape, damage):
            pieces.append(piece)
            continue
        try:
            whole = to_manifold(triangulate(piece.shape, chord), origin)
        except (InputError, ValueError):
            return None
        common = (whole ^ lost).volume()
        if common <= SPECK * damage.volume:
            pieces.append(piece)
            continue
        left = to_solid(whole - cutter, origin)
        bodies = [] if left is None else [body for body in split_bodies(left) if body.volume > SPECK * damage.volume]
        kept = sum(body.volume for body in bodies)
        room = VOLUME * whole.volume() + (chord + part.tessellation_error) * 2 * damage.area
        if abs(whole.volume() - common - kept) > room:
            return None
        pieces += [_build(body, piece) for body in bodies]
    return pieces


def _build(body: Solid, piece: Piece) -> Piece:
    from OCP.TopAbs import TopAbs_FACE

    shape, _ = build_solid(body)
    return replace(piece, shape=shape, origins=((-1, FACET),) * len(explore(shape, TopAbs_FACE)))


def _thicken(damage: Solid, part: Part, step: float) -> Solid:
    """The damage volume with its skin moved outward, but for its rim: two meshes of one CAD face differ."""
    inner = find_inner_faces(damage, part)
    free = np.ones(len(damage.vertices), bool)
    free[damage.faces[inner]] = False
    moved = np.array(damage.vertices)
    normals = normalise(damage.vertex_cross)
    moved[free] += step * normals[free]
    return Solid(moved, damage.faces)
