"""Shares a region out between ways to hold the tool, of which none is free all over it.

Passes that are drawn without regard to that fall into a piece for each change of the way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from damageest.artefacts import Flags, Floats, Ints
from damageest_paths.fill.regions import cover, drop_narrow, find_runs, list_pieces, shift_border, unite_regions
from damageest_paths.fill.stripes import Bead

MOST = 4
"""Parts of a region at most, but for pieces."""
LEAST = 2.0
"""Area in squares of the bead's width from which a piece is a part."""
WORTH = 0.05
"""Share of the places that a way has to serve which no other does."""
CLOSE, OPEN = 0.3, 0.4
"""Bead widths of which gaps and tips twice as wide are closed and cut at the border of a part."""


class Reached(NamedTuple):
    """``points`` (N,2) along a line, and whether each way to hold the tool is ``free`` at each of them (N,M)."""

    points: Floats
    free: Flags


def share_region(region: Any, lines: Sequence[Reached], bead: Bead) -> list[Any]:
    """The parts of a ``region``, in each of which one way is free. ``lines``: their beads cover the region; what no way
    serves belongs to no part."""
    width, rest, found = bead.width, region, list[Any]()
    points, free = (np.concatenate(column) for column in zip(*lines, strict=True))
    ways = _choose_ways(free)
    if not ways:
        return []
    own = _share_points(points, free[:, ways])
    starts = np.cumsum([len(line.points) for line in lines])[:-1]
    for number in range(len(ways)):
        served = np.split(own == number, starts)
        strokes = [run for line, now in zip(lines, served, strict=True) for run in _list_runs(line.points, now)]
        closed = shift_border(shift_border(cover(strokes, width), CLOSE * width), -CLOSE * width)
        part = drop_narrow(closed ^ rest, OPEN * width)
        large = unite_regions([piece for piece in list_pieces(part) if piece.area() > LEAST * width**2])
        if not large.is_empty():
            found.append(large)
            rest -= large
    # beads of one part lie as near to those of another as to each other
    between = (bead.width - bead.step) / 2
    return [shift_border(part, between) ^ region for part in found]


def _choose_ways(free: Flags) -> list[int]:
    """The numbers of few ways that serve most of the points between them, ``free`` (N,M): first that which serves most,
    then that which serves most of the rest (Chvatal 1979)."""
    left, found = np.ones(len(free), bool), list[int]()
    while len(found) < MOST and free[left].sum(axis=0).max() > WORTH * len(free):
        found.append(int(np.argmax(free[left].sum(axis=0))))
        left &= ~free[:, found[-1]]
    return found


def _share_points(points: Floats, free: Flags) -> Ints:
    """The way of each of the points (N,), of those that are ``free`` (N,K): the one that is free farthest round it; -1
    where none is."""
    depth = np.zeros(free.shape)
    for number, own in enumerate(free.T):
        shut = points[~own]
        depth[own, number] = cKDTree(shut).query(points[own])[0] if len(shut) else np.inf
    return np.where(free.any(axis=1), depth.argmax(axis=1), -1)


def _list_runs(line: Floats, wanted: Flags) -> list[Floats]:
    """The stretches (K,2) of a line at whose points it is wanted."""
    return [line[start:stop] for start, stop in find_runs(wanted)]
