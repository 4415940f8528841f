"""Chooses the tool axis of a pass so that the nozzle touches nothing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.paths.clearance import Clearance

RING, AROUND = np.radians(20.0), 8
"""Difference of tilt between the rings of axes that are tried, and their number round the build direction."""
SPARSE = 5
"""Points of a pass at which all axes are tried first."""
ROOM = 1.5
"""Multiple of the distance needed that counts as room to spare."""
BEST = 3
"""Axes with which the pieces of a pass are looked for where none is free all along."""


class Piece(NamedTuple):
    """Points ``start`` to ``stop`` (not included) of a pass with one ``axis`` (3,), and the gaps there."""

    start: int
    stop: int
    axis: Floats
    gaps: Floats


def list_axes(tilt: float, ring: float = RING, around: int = AROUND) -> Floats:
    """Axes (M,3) in local coordinates: the build direction z, then rings round it up to a ``tilt`` in radians."""
    rings = np.linspace(0, tilt, 1 + int(np.ceil(tilt / ring - 1e-9)))[1:] if tilt > 0 else np.empty(0)
    angle = 2 * np.pi * np.arange(around) / around
    found = [np.array([[0.0, 0.0, 1.0]])]
    for each in rings:
        sides = np.sin(each) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        found.append(np.column_stack([sides, np.full(around, np.cos(each))]))
    return np.concatenate(found)


def choose_axes(
    points: Floats, axes: Floats, first: int, clearance: Clearance, needed: float, least: int
) -> list[Piece]:
    """Pieces of a pass, each with an axis at which the nozzle keeps the distance ``needed``.

    Args:
        points: (N,3) of the pass, near to each other.
        axes: (M,3) to choose from, from the least tilted to the most.
        first: number of the axis to take if it is free all along, as that of the pass before.
        needed: least distance.
        least: least number of points of a piece.

    Returns:
        The pieces in the order of the points. Points in none of them cannot be reached. One piece with one axis where
        there is one that is free all along: ``first``, or the least tilted that has room to spare, or any.
    """
    gaps = _measure(points, axes[first], clearance, needed)
    if (gaps >= needed).all():
        return [Piece(0, len(points), axes[first], gaps)]
    if len(axes) == 1:
        return _cut(0, len(points), gaps[None], axes, needed, least)
    sparse = np.unique(np.linspace(0, len(points) - 1, SPARSE).round().astype(int))
    _, high = clearance.bound(
        np.tile(points[sparse], (len(axes), 1)), np.repeat(axes, len(sparse), axis=0), ROOM * needed
    )
    room = high.reshape(len(axes), len(sparse))
    free = (room >= needed).sum(axis=1)
    narrow = room.min(axis=1) < ROOM * needed
    order = np.lexsort([np.arange(len(axes)), narrow, -free])[:BEST]
    order = order[free[order] > 0]
    tried = [gaps]
    for k in order:
        gaps = _measure(points, axes[k], clearance, needed)
        if (gaps >= needed).all():
            return [Piece(0, len(points), axes[k], gaps)]
        tried.append(gaps)
    chosen = np.concatenate([axes[[first]], axes[order]])
    return sorted(_cut(0, len(points), np.array(tried), chosen, needed, least), key=lambda piece: piece.start)


def _measure(points: Floats, axis: Floats, clearance: Clearance, needed: float) -> Floats:
    return clearance.measure_poses(points, np.tile(axis, (len(points), 1)), needed)


def _cut(start: int, stop: int, gaps: Floats, axes: Floats, needed: float, least: int) -> list[Piece]:
    """The longest free piece between two points, and what is left before and after it, cut in the same way."""
    pieces: list[Piece] = []
    todo = [(start, stop)]
    while todo:
        low, high = todo.pop()
        found = max((_find_longest(row[low:high] >= needed) for row in gaps), default=(0, 0), key=lambda each: each[1])
        if found[1] < max(least, 1):
            continue
        number = [_find_longest(row[low:high] >= needed)[1] for row in gaps].index(found[1])
        first = low + _find_longest(gaps[number, low:high] >= needed)[0]
        last = first + found[1]
        pieces.append(Piece(first, last, axes[number], gaps[number, first:last]))
        todo += [(low, first), (last, high)]
    return pieces


def _find_longest(free: Flags) -> tuple[int, int]:
    """Start and length of the longest run of True."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(free, int), [0]])))
    starts, stops = edges[::2], edges[1::2]
    if not len(starts):
        return 0, 0
    k = int(np.argmax(stops - starts))
    return int(starts[k]), int(stops[k] - starts[k])
