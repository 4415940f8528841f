"""The two skins of a thin wall told apart, where a neighbourhood of points is wider than the wall is thick."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.neighbourhoods import query_neighbours

LEAST_GAP = 0.5
"""Gap between two sheets, as a share of the range of all heights: one sheet, or an edge, has none."""
LEAST_WALL = 0.15
"""Gap between two sheets, as a share of the radius of the neighbourhood: steps of a sensor's depth are smaller."""
FLAT = 0.1
"""Thickness of a neighbourhood over its width, below which it is one sheet."""
LEAST_SHARE = 0.3
"""Share of the neighbours on the place's own sheet, at least; with fewer the place itself is an outlier."""
FEWEST = 6
"""Neighbours below which sheets are not told apart."""
ROUNDS = 3
"""How often the normal is found from the two sheets, and these from the normal."""
FEW = 8
"""Nearest neighbours that lie on one sheet where the wall is about as thick as the gaps between the points."""
WIDE = 32
"""Neighbours from which sheets are told apart for certain, at least."""
MORE = 3
"""How many times more neighbours are asked for where too few lie on the place's own sheet."""


def find_own_sheet(off: Floats, is_there: Flags | None = None) -> Flags:
    """Which of the neighbours (N,K,3) of each place, relative to it and nearest first, lie on the same sheet as the
    place itself, which is the first of them.

    Two sheets are parallel: both spread least along one normal, and a gap lies between them along it. All lie on one
    sheet where no gap is wide enough. ``is_there`` (N,K): which of the columns count; the first has to.
    """
    is_there = np.ones(off.shape[:2], bool) if is_there is None else is_there
    if off.shape[1] < FEWEST:
        return is_there
    own, squares = is_there.copy(), np.linalg.eigvalsh(measure_spread(off, is_there))
    asked = np.flatnonzero(squares[:, 0] > FLAT**2 * squares[:, 1])
    off, is_there = off[asked], is_there[asked]
    best = np.zeros(len(off))
    for nearest in (off.shape[1], FEW):  # where few are on another sheet, these tilt a plane through all
        gap, part = _part_sheets(off, is_there, nearest)
        own[asked[gap > best]] = part[gap > best]
        best = np.maximum(gap, best)
    return own


def _part_sheets(off: Floats, is_there: Flags, nearest: int) -> tuple[Floats, Flags]:
    """The gap (N,) between two sheets as a share of all heights, 0 where there are not two, and what lies on the
    place's own (N,K). From a plane through the ``nearest`` ones on."""
    row = np.arange(len(off))
    spread = measure_spread(off[:, :nearest], is_there[:, :nearest])
    for _ in range(ROUNDS):
        heights = np.einsum("nki,ni->nk", off, np.linalg.eigh(spread)[1][:, :, 0])
        high = np.where(is_there, heights, -np.inf).max(axis=1)
        ordered = np.sort(np.where(is_there, heights, high[:, None]), axis=1)  # what is not there leaves no gap
        below = _part_evenly(ordered)
        upper = heights > (ordered[row, below] + ordered[row, below + 1])[:, None] / 2
        spread = measure_spread(off, is_there & ~upper) + measure_spread(off, is_there & upper)
    gap = ordered[row, below + 1] - ordered[row, below]
    share = gap / np.maximum(high - ordered[:, 0], 1e-300)
    reach = np.sqrt(np.where(is_there, (off**2).sum(axis=2), 0).max(axis=1))
    own = is_there & (upper == upper[:, :1])
    are_two = (share > LEAST_GAP) & (gap > LEAST_WALL * reach)
    are_two &= own.sum(axis=1) >= LEAST_SHARE * is_there.sum(axis=1)
    return np.where(are_two, share, 0.0), np.where(are_two[:, None], own, is_there)


def measure_spread(off: Floats, chosen: Flags) -> Floats:
    """The sum (N,3,3) of products of the ``chosen`` (N,K) of vectors (N,K,3) about their mean."""
    weight = chosen.astype(float)
    count = np.maximum(weight.sum(axis=1), 1)
    mean = np.einsum("nk,nki->ni", weight, off) / count[:, None]
    around = off * weight[..., None]
    products = np.matmul(around.transpose(0, 2, 1), off)
    return np.asarray(products - count[:, None, None] * mean[:, :, None] * mean[:, None, :])


def _part_evenly(ordered: Floats) -> Ints:
    """Where (N,) ascending values (N,K) part into two groups that each spread least (Otsu 1979, one threshold): the
    last of the lower group."""
    count = ordered.shape[1]
    lower = np.arange(1, count)
    total = np.cumsum(ordered, axis=1)
    apart = total[:, :-1] / lower - (total[:, -1:] - total[:, :-1]) / (count - lower)
    return np.asarray((lower * (count - lower) * apart**2).argmax(axis=1))


def query_own_sheet(tree: Any, places: Floats, points: Floats, count: int) -> tuple[Floats, Ints]:
    """As `query_neighbours` among the points (M,3) of a tree, for places (N,3) that are points of it; where the
    neighbours of a place lie on both skins of a thin wall, those on its own."""
    wide = max(count, min(WIDE, len(points)))
    distance, index = query_neighbours(tree, places, wide)
    own = find_own_sheet(points[index] - places[:, None])
    few = np.flatnonzero(own.sum(axis=1) < count)
    near = _take_first(distance, index, own, count)
    if len(few) and wide * MORE <= len(points):
        far, more = query_neighbours(tree, places[few], wide * MORE)
        beside = find_own_sheet(points[more] - places[few, None])
        enough = beside.sum(axis=1) >= count
        for column, new in zip(near, _take_first(far, more, beside, count), strict=True):
            column[few[enough]] = new[enough]
    return near


def _take_first(distance: Floats, index: Ints, own: Flags, count: int) -> tuple[Floats, Ints]:
    """The first ``count`` columns that are ``own``; where there are fewer, the first of all."""
    order = np.argsort(~own & (own.sum(axis=1) >= count)[:, None], axis=1, kind="stable")[:, :count]
    return np.take_along_axis(distance, order, axis=1), np.take_along_axis(index, order, axis=1)
