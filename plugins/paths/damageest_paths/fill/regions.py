"""Regions of a plane as manifold3d's CrossSection, which has the polygons and offsets of Clipper2.

A region is typed Any. Lengths are in the job's unit.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints

ROUND = 24
"""Corners of a full circle where a bead's end is drawn as a polygon."""
TURN = np.radians(15.0)
"""Turn of a line up to which the border of its bead goes on without a corner of its own."""
SAME = 0.002
"""Bead widths by which a corner may lie beside a line and be left out where its bead is drawn."""
RAGGED, EVEN = 0.15, 0.01
"""Bead widths within which a border is smoothed, and within which it is simplified."""
CHUNK = 1000
"""Points that are compared with all sides of a region at once."""


def make_region(polygons: Sequence[Floats]) -> Any:
    """The union of closed polygons (K,2); those that are wound clockwise are holes."""
    from manifold3d import CrossSection, FillRule

    return CrossSection(list(polygons), FillRule.Positive) if len(polygons) else CrossSection()


def unite_regions(regions: Sequence[Any]) -> Any:
    """The union of regions; empty without any."""
    from manifold3d import CrossSection, OpType

    kept = [region for region in regions if not region.is_empty()]
    return CrossSection.batch_boolean(kept, OpType.Add) if kept else CrossSection()


def list_pieces(region: Any) -> list[Any]:
    """The connected pieces of a region; none of an empty one, which `decompose` gives back with endless bounds."""
    return [piece for piece in region.decompose() if piece.area() > 0]


def shift_border(region: Any, distance: float) -> Any:
    """The region grown by ``distance`` with round corners, or shrunk where that is negative."""
    from manifold3d import JoinType

    if region.is_empty() or not distance:
        return region
    return region.offset(distance, JoinType.Round, 2.0, ROUND)


def drop_narrow(region: Any, radius: float, keeps_corners: bool = False) -> Any:
    """The region without what is narrower than twice a radius. Its corners become round, or stay as they are."""
    from manifold3d import JoinType

    shrunk = shift_border(region, -radius)
    if shrunk.is_empty() or not keeps_corners:
        return shift_border(shrunk, radius)
    return shrunk.offset(0.998 * radius, JoinType.Miter, 2.0)


def smooth_border(region: Any, width: float) -> Any:
    """A region without what is ragged along its border, as on a scanned floor: that gives beads of no worth. ``width``
    of a bead."""
    grown = shift_border(shift_border(region, RAGGED * width), -2 * RAGGED * width)
    return shift_border(grown, RAGGED * width).simplify(EVEN * width)


def turn_points(points: Floats, angle: float) -> Floats:
    """Points (N,2), turned about 0 by an angle in radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(points @ np.array([[c, s], [-s, c]]))


def cover(lines: Sequence[Floats], width: float) -> Any:
    """The region that beads of a width cover whose centre lines are the polylines (K,2). Their ends are round."""
    from manifold3d import CrossSection, FillRule

    strips = [strip for line in lines for strip in _list_strips(thin_line(line, SAME * width), width / 2)]
    return CrossSection(strips, FillRule.NonZero) if strips else CrossSection()


def thin_line(line: Floats, off: float) -> Floats:
    """A polyline (K,2) without corners that lie ``off`` beside it at most."""

    def measure_off(low: int, high: int) -> Floats:
        way, away = line[high] - line[low], line[low + 1 : high] - line[low]
        share = np.clip(away @ way / max(float(way @ way), 1e-300), 0, 1)
        return np.asarray(np.linalg.norm(away - share[:, None] * way, axis=1))

    return line[find_corners(len(line), measure_off, off)]


def find_corners(count: int, measure_off: Callable[[int, int], Floats], most: float) -> Ints:
    """The numbers of the points of a polyline that are kept so that none between is off by more than ``most`` (Douglas
    and Peucker 1973). ``measure_off``: of two numbers, how far each point between is off the line between them."""
    kept, todo = {0, count - 1}, [(0, count - 1)]
    while todo:
        low, high = todo.pop()
        if high - low > 1 and (off := measure_off(low, high)).max() > most:
            middle = low + 1 + int(off.argmax())
            kept.add(middle)
            todo += [(low, middle), (middle, high)]
    return np.array(sorted(kept))


def _list_strips(line: Floats, radius: float) -> list[Floats]:
    """Polygons (K,2) that together are all places up to a radius from a polyline, with round ends. It is cut where it
    turns sharply, or within a short stretch: elsewhere one polygon follows both of its sides."""
    if len(line) == 1:
        line = np.concatenate([line, line])
    sides = np.diff(line, axis=0)
    long = np.linalg.norm(sides, axis=1)
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    turn = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi)
    # where a side is shorter than that, the overlap of two strips inside of the turn reaches beyond it
    sharp = (turn > TURN) | (np.minimum(long[1:], long[:-1]) < radius * np.tan(np.minimum(turn, TURN)))
    cuts = [0, *(np.flatnonzero(sharp) + 1).tolist(), len(line) - 1]
    across = radius * np.column_stack([-np.sin(angle), np.cos(angle)])
    half = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)[1:-1]
    found = []
    for low, high in pairwise(cuts):
        both = np.stack([line[low:high], line[low + 1 : high + 1]], axis=1)
        side = across[low:high, None]
        ahead, behind = angle[high - 1] + half, angle[low] + np.pi + half
        front = line[high] + radius * np.column_stack([np.cos(ahead), np.sin(ahead)])
        back = line[low] + radius * np.column_stack([np.cos(behind), np.sin(behind)])
        left, right = (both + side).reshape(-1, 2), (both - side).reshape(-1, 2)
        found.append(np.concatenate([right, front, left[::-1], back]))
    return found


def close_ring(ring: Floats) -> Floats:
    """The corners (K,2) of a ring with the first one again at the end."""
    return np.concatenate([ring, ring[:1]])


def measure_length(line: Floats) -> float:
    """The length of a polyline (K,2) or (K,3)."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def find_main_angle(region: Any) -> float:
    """The angle in radians of the longer side of the smallest rectangle round a region."""
    (outline,) = region.hull().to_polygons() or (np.zeros((1, 2)),)
    sides = np.roll(outline, -1, axis=0) - outline
    angles = np.arctan2(sides[:, 1], sides[:, 0])
    best, found = np.inf, 0.0
    for angle in np.unique(np.round(np.mod(angles, np.pi / 2), 9)):
        width, height = np.ptp(turn_points(outline, -float(angle)), axis=0)
        if width * height < best * (1 - 1e-9):
            best, found = width * height, float(angle) + (0.0 if width >= height else np.pi / 2)
    return found


def find_runs(wanted: Flags) -> Ints:
    """The first and the last number (K,2), not included, of each stretch of numbers that are ``wanted`` (N,)."""
    return np.flatnonzero(np.diff(np.concatenate([[0], wanted.astype(int), [0]]))).reshape(-1, 2)


def resample(line: Floats, longest: float) -> tuple[Floats, Floats]:
    """Points (N,3) along a polyline (K,3), no farther from each other than ``longest``, with its corners; and the
    number of the corner (N,) that each is, -1 for one between corners."""
    sides = np.diff(line, axis=0)
    counts = np.maximum(np.ceil(np.linalg.norm(sides, axis=1) / longest - 1e-9).astype(int), 1)
    share = np.concatenate([np.arange(count) / count for count in counts] or [np.empty(0)])
    points = np.repeat(line[:-1], counts, axis=0) + share[:, None] * np.repeat(sides, counts, axis=0)
    corner = np.where(share == 0, np.repeat(np.arange(len(sides)), counts), -1)
    return np.concatenate([points, line[-1:]]), np.append(corner, len(line) - 1)


def is_within(points: Floats, region: Any) -> Flags:
    """Whether each of ``points`` (N,2) lies in a region (N,): where a ray from it crosses an odd number of sides."""
    inside = np.zeros(len(points), bool)
    for ring in region.to_polygons():
        start = np.asarray(ring, dtype=np.float64)
        stop = np.roll(start, -1, axis=0)
        rise = np.where(stop[:, 1] == start[:, 1], 1.0, stop[:, 1] - start[:, 1])
        for first in range(0, len(points), CHUNK):
            x, y = points[first : first + CHUNK].T[:, :, None]
            spans = (start[:, 1] > y) != (stop[:, 1] > y)
            at = start[:, 0] + (y - start[:, 1]) / rise * (stop[:, 0] - start[:, 0])
            inside[first : first + CHUNK] ^= ((spans & (x < at)).sum(axis=1) % 2).astype(bool)
    return inside
