"""Fills a region with parallel rows that cover all of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.regions import cover, list_pieces, turn_points
from damageest_paths.fill.trim import trim_line

NEAR, FAR = 1.0, 6.0
"""Bead widths along the rows up to which the end of one row is linked with the end of the next: in any case, and where
the link stays near enough to the region."""
THIN = 0.1
"""Bead widths at the two sides of a region that do not lengthen a row: beside so thin a tip the bead would spill."""
BESIDE = 0.35
"""Bead widths that the centre line of a link may be outside the region."""


@dataclass(frozen=True)
class Bead:
    """``width``; ``step``: the distance of the centre lines of neighbouring beads."""

    width: float
    step: float

    @property
    def inset(self) -> float:
        """How far before the end of the region a row may stop so that its round end still covers the row's corners."""
        return float(np.sqrt(max(self.width**2 - self.step**2, 0.0)) / 2)

    def find_inset(self, reach: float) -> float:
        """The same for corners ``reach`` from the centre line, but not less than half as much as for other rows."""
        return float(np.clip(np.sqrt(max(self.width**2 / 4 - reach**2, 0.0)), self.inset / 2, self.inset))


@dataclass
class _Row:
    """A piece of a row from ``low`` to ``high`` at ``height``, in the rows' coordinates."""

    number: int
    height: float
    low: float
    high: float
    used: bool = False


def fill_with_rows(region: Any, bead: Bead, angle: float, linked: bool = True, free: Any = None) -> list[Floats]:
    """Polylines (K,2) along an ``angle`` in radians whose beads cover the whole region.

    Rows are evenly spaced, by the bead's step at most. Each row covers a stripe, and reaches as far as any point of the
    region within the stripe does. ``linked``: whether neighbouring rows are one polyline, to and fro, where they lie
    side by side. ``free``: the region in which rows and links have to lie, None for everywhere.
    """
    turned = region.rotate(float(-np.degrees(angle)))
    within = None if free is None else free.rotate(float(-np.degrees(angle)))
    lines: list[Floats] = []
    for piece in sorted(list_pieces(turned), key=lambda each: each.bounds()):
        rows = _find_rows(piece, bead)
        around = piece.offset(BESIDE * bead.width)
        if within is not None:
            rows = [part for row in rows for part in _trim(row, within, bead)]
            around = within
        lines += _link(rows, bead, around if linked else None, NEAR if within is None else 0.0)
    return [turn_points(line, angle) for line in lines]


def _find_rows(piece: Any, bead: Bead) -> list[_Row]:
    """The rows of a connected region, from below, and from left to right."""
    left, low, right, high = piece.bounds()
    extent = high - low
    if extent <= bead.width:
        return [_shorten(0, (low + high) / 2, left, right, bead, extent / 2)]
    count = 1 + int(np.ceil((extent - bead.width) / bead.step - 1e-9))
    heights = np.linspace(low + bead.width / 2, high - bead.width / 2, count)
    thin = THIN * bead.width
    edges = np.concatenate([[low + thin], (heights[1:] + heights[:-1]) / 2, [high - thin]])
    return [row for number in range(count) for row in _cut(piece, number, heights[number], edges, bead)]


def _cut(piece: Any, number: int, height: float, edges: Floats, bead: Bead) -> list[_Row]:
    """The rows in one stripe. Pieces nearer to each other than half a bead become one."""
    from manifold3d import CrossSection

    left, _, right, _ = piece.bounds()
    low, high = float(edges[number]), float(edges[number + 1])
    stripe = CrossSection.square((right - left + 2, high - low)).translate((left - 1, low))
    spans = sorted(each.bounds() for each in list_pieces(piece ^ stripe))
    merged: list[list[float]] = []
    outside = THIN * bead.width if number in (0, len(edges) - 2) else 0.0
    for start, bottom, stop, top in spans:
        reach = max(height - bottom, top - height) + outside
        if merged and start - merged[-1][1] < bead.width / 2:
            merged[-1][1:] = [max(merged[-1][1], stop), max(merged[-1][2], reach)]
        else:
            merged.append([start, stop, reach])
    return [_shorten(number, height, start, stop, bead, reach) for start, stop, reach in merged]


def _shorten(number: int, height: float, low: float, high: float, bead: Bead, reach: float) -> _Row:
    inset = min(bead.find_inset(reach), 0.5 * (high - low) - 1e-3 * bead.width)
    middle = (low + high) / 2
    if inset <= 0:
        return _Row(number, float(height), middle - 5e-4 * bead.width, middle + 5e-4 * bead.width)
    return _Row(number, float(height), low + inset, high - inset)


def _trim(row: _Row, free: Any, bead: Bead) -> list[_Row]:
    """The pieces of a row that lie in a region."""
    pieces = trim_line(np.array([[row.low, row.height], [row.high, row.height]]), free, bead.width)
    return [_Row(row.number, row.height, float(piece[0, 0]), float(piece[-1, 0])) for piece in pieces]


def _link(rows: list[_Row], bead: Bead, around: Any, near: float) -> list[Floats]:
    """Rows as polylines, to and fro where their links lie in the region ``around``, or are not longer than ``near`` in
    bead widths; each its own where that is None."""
    by_number: dict[int, list[_Row]] = {}
    for row in rows:
        by_number.setdefault(row.number, []).append(row)
    lines = []
    for first in rows:
        if first.used:
            continue
        points, row, forward = [], first, True
        while True:
            row.used = True
            ends = (row.low, row.high) if forward else (row.high, row.low)
            points += [(ends[0], row.height), (ends[1], row.height)]
            above = by_number.get(row.number + 1, []) if around is not None else []
            found = _find_next(row, ends[1], above, forward, bead, around, near)
            if found is None:
                break
            row, forward = found, not forward
        lines.append(np.array(points))
    return lines


def _find_next(
    row: _Row, end: float, above: list[_Row], forward: bool, bead: Bead, around: Any, near: float
) -> _Row | None:
    """The row above that goes on where this one ends; None where it is not beside it, or another lies between."""
    beside = [other for other in above if other.low <= row.high and row.low <= other.high]
    if not beside:
        return None
    other = max(beside, key=lambda each: each.high) if forward else min(beside, key=lambda each: each.low)
    goal = other.high if forward else other.low
    if other.used or abs(goal - end) > FAR * bead.width:
        return None
    if not near or abs(goal - end) > near * bead.width:
        strip = cover([np.array([[end, row.height], [goal, other.height]])], 1e-3 * bead.width)
        if (strip - around).area() > 1e-7 * bead.width**2:
            return None
    return other
