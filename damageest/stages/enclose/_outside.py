"""A damage surface extended beyond its rims until it ends outside the part."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Surface
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.vectors import normalise
from damageest.stages.enclose._close import MOST_THROUGH, measure_through
from damageest.stages.enclose._sew import extend_rims, fill_loops

CLEAR = 0.3
"""How far outside the part the extended surface ends at least, in tolerances."""
ROUNDS = 6
"""How often a border is divided and moved where it still touches the part."""
SMOOTHINGS = 4
"""How often the directions along a border are averaged with their neighbours'."""


def extend_outside(surface: Surface, rims: Rims, part: Part, width: float, tolerance: float) -> Mesh:
    """The surface, its holes filled, extended by ``width`` in its own direction beyond each rim, and from there out of
    the part by the shortest way. The first faces are those of the surface.

    Lengths are in the part's unit. Raises StageError where there is no rim, or where what was added runs through more
    metal than a gap of the scan at the rim explains.
    """
    wide = extend_rims(surface, rims, width)
    vertices, faces, added = [wide.vertices], [fill_loops(wide)], [wide.faces[len(surface.faces) :]]
    start = len(wide.vertices)
    for loop in wide.loops:
        end, source = _leave_part(wide.vertices[loop], part, CLEAR * tolerance)
        vertices.append(end)
        added.append(_build_band(loop, start + np.arange(len(end)), source))
        faces.append(added[-1])
        start += len(end)
    sheet = Mesh(np.concatenate(vertices), np.concatenate(faces))
    share = measure_through(Mesh(sheet.vertices, np.concatenate(added)), part, tolerance) / max(surface.area, 1e-300)
    if share > MOST_THROUGH:
        raise StageError(
            f"from its rim the damage surface reaches the skin only through metal (area: {share:.0%} of the surface)",
            "a scan without gaps at the rim",
            method="implicit",
        )
    return sheet


def _leave_part(at: Floats, part: Part, clear: float) -> tuple[Floats, Ints]:
    """A closed border outside the part for one at ``at`` (N,3): its nodes (M,3), M at least N, and for each the number
    of the node of ``at`` that it comes from; the numbers rise.

    A node that lies outside stays about where it is.
    """
    distance, _ = signed_distance(at, part)
    _, _, foot = closest_on_mesh(at, part)
    way = normalise(np.where(distance[:, None] < 0, foot - at, at - foot))
    for _ in range(SMOOTHINGS):
        way = way + np.roll(way, 1, axis=0) + np.roll(way, -1, axis=0)
    way = normalise(way)
    source = np.arange(len(at))
    end = _push(at, way, part, clear)
    for _ in range(ROUNDS):
        middle, step = (end + np.roll(end, -1, axis=0)) / 2, normalise(way + np.roll(way, -1, axis=0))
        within = np.flatnonzero(signed_distance(middle, part)[0] < 0.5 * clear)
        if not len(within):
            break
        more = _push(middle[within], step[within], part, clear)
        order = np.argsort(np.concatenate([np.arange(len(end)), within + 0.5]), kind="stable")
        end, way = np.concatenate([end, more])[order], np.concatenate([way, step[within]])[order]
        source = np.concatenate([source, source[within]])[order]
    return end, source


def _push(places: Floats, way: Floats, part: Part, clear: float) -> Floats:
    """Places (N,3) moved along unit directions (N,3) until they are ``clear`` outside the part, or nearly."""
    at = places.copy()
    for _ in range(20):
        lack = clear - signed_distance(at, part)[0]
        far = np.flatnonzero(lack > 0.05 * clear)
        if not len(far):
            break
        at[far] += lack[far, None] * way[far]
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
