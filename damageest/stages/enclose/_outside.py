"""A damage surface extended beyond its rims until it ends outside the part."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Part, Rims, Surface
from damageest.errors import StageError
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.vectors import normalise
from damageest.stages.enclose._close import MOST_THROUGH, measure_through
from damageest.stages.enclose._sew import ExtendedSurface, fill_loops, point_outward

CLEAR = 0.3
"""How far outside the part the extended surface ends at least, in tolerances."""
STEP = 0.5
"""Distance of the places where the border is looked at, as a share of `CLEAR`."""
FEWEST_NODES = 8
"""Nodes of the outer border of a strip, at least."""
LONGEST = 4
"""Largest width of a strip where the rim is deep, for that where it is not."""
UNFOLDED = 20
"""How often nodes of that border are moved between their neighbours where it runs back."""
ROUNDS = 8
"""How often a border is divided and moved where it still touches the part."""
MOVES = 4
"""How often a node is moved, at most."""


@dataclass(frozen=True, eq=False)
class Sheet:
    """``mesh``: a damage surface, extended until it ends outside the part; its first vertices and faces are those of
    the surface itself, ``own``.

    ``places`` (K,3) on its border that may lie in the part all the same, and the way ``deep`` (K,) of each to where it
    is clear of the part.
    """

    mesh: Mesh
    own: Surface
    places: Floats
    deep: Floats


def extend_outside(surface: Surface, rims: Rims, part: Part, width: float, tolerance: float) -> Sheet:
    """The surface, its holes filled, extended by ``width`` in its own direction beyond each rim, and from there out of
    the part by the shortest way.

    Lengths are in the part's unit. Raises StageError where there is no rim, or where what was added runs through more
    metal than a gap of the scan at the rim explains.
    """
    wide = _extend_rims(surface, rims, part, width)
    vertices, faces, added = [wide.vertices], [fill_loops(wide)], []
    start, places = len(wide.vertices), []
    for loop in wide.loops:
        end, source = _leave_part(wide.vertices[loop], part, CLEAR * tolerance)
        vertices.append(end)
        added.append(_build_band(loop, start + np.arange(len(end)), source))
        faces.append(added[-1])
        places.append(_trace(end, STEP * CLEAR * tolerance))
        start += len(end)
    sheet = Mesh(np.concatenate(vertices), np.concatenate(faces))
    share = measure_through(Mesh(sheet.vertices, np.concatenate(added)), part, tolerance) / max(surface.area, 1e-300)
    if share > MOST_THROUGH:
        raise StageError(
            f"from its rim the damage surface reaches the skin only through metal (area: {share:.0%} of the surface)",
            "scan the rim without gaps",
            method="implicit",
        )
    at = np.concatenate(places)
    deep = CLEAR * tolerance - signed_distance(at, part)[0]
    still = np.flatnonzero(deep > (1 - STEP / 2) * CLEAR * tolerance)  # between two places it may lie in the part
    return Sheet(sheet, surface, at[still], deep[still])


def _extend_rims(surface: Surface, rims: Rims, part: Part, width: float) -> ExtendedSurface:
    """The surface with a strip of about ``width`` along each rim, in the direction in which the surface ends there; of
    more where the rim lies deep in the part.

    The outer border has a node for every half width of the rim, so that it is smooth where the rim is jagged: a strip
    that folds back does not divide.
    """
    if not rims.loops:
        raise StageError("the damage surface has no rim to join to the background", method="implicit")
    vertices, faces, ends = [surface.vertices], [surface.faces], []
    start = len(surface.vertices)
    for loop in rims.loops:
        far, source = _place_border(surface, loop, part, width)
        vertices.append(far)
        ends.append(start + np.arange(len(far)))
        faces.append(_build_band(ends[-1], loop, source)[:, ::-1])
        start += len(far)
    return ExtendedSurface(np.concatenate(vertices), np.concatenate(faces), tuple(ends))


def _place_border(surface: Surface, loop: Ints, part: Part, width: float) -> tuple[Floats, Ints]:
    """The nodes (M,3) of the outer border of a strip along a rim (N,), and for each node of the rim the number (N,) of
    that which it is joined to; the numbers rise."""
    at = surface.vertices[loop]
    step = np.linalg.norm(np.roll(at, -1, axis=0) - at, axis=1)
    place = np.cumsum(step) - step
    count = int(np.clip(2 * step.sum() / width, FEWEST_NODES, len(loop)))
    _, source = np.unique(place * count // step.sum(), return_inverse=True)
    middle, out = (_average_groups(values, source) for values in (at, point_outward(surface, loop)))
    out = normalise(out + 0.5 * (np.roll(out, 1, axis=0) + np.roll(out, -1, axis=0)))
    far, way = middle + _choose_widths(middle, out, part, width)[:, None] * out, np.roll(middle, -1, axis=0) - middle
    for _ in range(UNFOLDED):
        back = np.flatnonzero(np.einsum("ij,ij->i", np.roll(far, -1, axis=0) - far, way) <= 0)
        if not len(back):
            break
        smooth = (np.roll(far, 1, axis=0) + np.roll(far, -1, axis=0)) / 2
        nodes = np.union1d(back, (back + 1) % len(far))
        far[nodes] = smooth[nodes]
    return far, source


def _choose_widths(middle: Floats, out: Floats, part: Part, width: float) -> Floats:
    """For each node (M,3) the least multiple of ``width`` by which the way ``out`` (M,3) leads out of the part; the
    width itself where none does."""
    times = np.arange(1, LONGEST + 1)
    ends = middle + width * times[:, None, None] * out
    is_out = signed_distance(ends.reshape(-1, 3), part)[0].reshape(LONGEST, -1) > 0
    chosen = np.where(is_out.any(axis=0), times[is_out.argmax(axis=0)], 1).astype(float)
    return np.asarray(width * np.maximum(chosen, (np.roll(chosen, 1) + np.roll(chosen, -1)) / 2))


def _average_groups(values: Floats, group: Ints) -> Floats:
    """The means (M,3) of rows (N,3) by the number (N,) of their group."""
    sums = np.stack([np.bincount(group, weights=column) for column in values.T], axis=1)
    return np.asarray(sums / np.bincount(group)[:, None])


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
