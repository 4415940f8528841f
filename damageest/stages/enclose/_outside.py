"""A damage surface extended beyond its rims until it ends outside the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Surface
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.vectors import normalise
from damageest.stages.enclose._close import MOST_THROUGH, measure_through
from damageest.stages.enclose._sew import extend_rims, fill_loops

CLEAR = 0.3
"""How far outside the part the extended surface ends at least, in tolerances."""
ROUNDS = 8
"""How often a border is divided and moved where it still touches the part."""
MOVES = 4
"""How often a node is moved, at most."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """``mesh``: a damage surface, extended until it ends outside the part; its first ``own`` faces are the surface.
    ``places`` (K,3) on its border that lie in the part all the same, and how far each is from the outside, ``deep``
    (K,)."""

    mesh: Mesh
    own: int
    places: Floats
    deep: Floats


def extend_outside(surface: Surface, rims: Rims, part: Part, width: float, tolerance: float) -> Sheet:
    """The surface, its holes filled, extended by ``width`` in its own direction beyond each rim, and from there out of
    the part by the shortest way.

    Lengths are in the part's unit. Raises StageError where there is no rim, or where what was added runs through more
    metal than a gap of the scan at the rim explains.
    """
    wide = extend_rims(surface, rims, width)
    vertices, faces, added = [wide.vertices], [fill_loops(wide)], [wide.faces[len(surface.faces) :]]
    start, places = len(wide.vertices), []
    for loop in wide.loops:
        end, source = _leave_part(wide.vertices[loop], part, CLEAR * tolerance)
        vertices.append(end)
        added.append(_build_band(loop, start + np.arange(len(end)), source))
        faces.append(added[-1])
        places.append(_trace(end, 0.5 * CLEAR * tolerance))
        start += len(end)
    sheet = Mesh(np.concatenate(vertices), np.concatenate(faces))
    share = measure_through(Mesh(sheet.vertices, np.concatenate(added)), part, tolerance) / max(surface.area, 1e-300)
    if share > MOST_THROUGH:
        raise StageError(
            f"from its rim the damage surface reaches the skin only through metal (area: {share:.0%} of the surface)",
            "a scan without gaps at the rim",
            method="implicit",
        )
    at = np.concatenate(places)
    deep = CLEAR * tolerance - signed_distance(at, part)[0]
    still = np.flatnonzero(deep > CLEAR * tolerance)
    return Sheet(sheet, len(surface.faces), at[still], deep[still])


def _trace(border: Floats, step: float) -> Floats:
    """Places (M,3) along a closed border (N,3), at most a ``step`` apart."""
    way = np.roll(border, -1, axis=0) - border
    count = np.ceil(np.linalg.norm(way, axis=1) / step).astype(np.int64).clip(1)
    which = np.repeat(np.arange(len(border)), count)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)) / count[which]
    return np.asarray(border[which] + share[:, None] * way[which])


def _leave_part(at: Floats, part: Part, clear: float) -> tuple[Floats, Ints]:
    """A closed border outside the part for one at ``at`` (N,3): its nodes (M,3), M at least N, and for each the number
    of the node of ``at`` that it comes from; the numbers rise.

    A node that lies outside stays where it is. Where two neighbours leave by different faces, nodes are put between
    them until the line from one to the other passes outside the edge of these faces.
    """
    end, source = _move_out(at, part, clear), np.arange(len(at))
    for _ in range(ROUNDS):
        middle = (end + np.roll(end, -1, axis=0)) / 2
        within = np.flatnonzero(signed_distance(middle, part)[0] < 0.5 * clear)
        if not len(within):
            break
        more = _move_out(middle[within], part, clear)
        order = np.argsort(np.concatenate([np.arange(len(end)), within + 0.5]), kind="stable")
        end = np.concatenate([end, more])[order]
        source = np.concatenate([source, source[within]])[order]
    return end, source


def _move_out(places: Floats, part: Part, clear: float) -> Floats:
    """Places (N,3), those that are not ``clear`` outside the part moved there by the shortest way.

    Between walls that are nearer to each other they end in the middle.
    """
    at = places.copy()
    for _ in range(MOVES):
        distance, _ = signed_distance(at, part)
        far = np.flatnonzero(distance < 0.9 * clear)
        if not len(far):
            break
        distance = distance[far]
        _, face, foot = closest_on_mesh(at[far], part)
        way = np.sign(distance)[:, None] * (at[far] - foot)
        flat = np.abs(distance) < 0.1 * clear  # too near for a direction
        way = np.where(flat[:, None], part.face_normals[face], normalise(way))
        at[far] = foot + clear * way
    return at


def _build_band(loop: Ints, end: Ints, source: Ints) -> Ints:
    """Faces between a border ``loop`` (N,) and its continuation ``end`` (M,), whose nodes come from the loop's by
    ``source`` (M,)."""
    after = np.roll(source, -1)
    here, there = loop[source], loop[after]
    next_end = np.roll(end, -1)
    wide = source != after
    first = np.stack([there, here, end], axis=1)[wide]
    second = np.stack([np.where(wide, there, here), end, next_end], axis=1)
    return np.concatenate([first, second])
