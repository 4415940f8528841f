"""Fills a region with few long passes: a ring along its border, and rows along its long axis within, or a spiral."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from damageest_paths.fill.joints import end_at_reversals, join_ends
from damageest_paths.fill.lines import Line
from damageest_paths.fill.middles import draw_thin
from damageest_paths.fill.regions import (
    close_ring,
    cover,
    find_main_angle,
    list_pieces,
    measure_length,
    shift_border,
    turn_points,
)
from damageest_paths.fill.rings import INSIDE, draw_one, draw_spiral, list_levels, read_rings, soften, start_farthest
from damageest_paths.fill.stripes import Bead, fill_with_rows

LONG = 1.6
"""Length over width of the rectangle round a piece from which its rows run along it in every layer."""
NEARER = 0.85
"""Share of a step from a ring to the border of the rows within it: their ends are round."""
THIN = 0.08
"""Area, in squares of the bead's width, of what a ring does not cover of a thin piece, from which it gets a line."""
WAY, MISSED = 8.0, 6.0
"""Bead widths of way that a pass more costs, and a square of the bead's width that stays without a bead."""
SCRAP = 1.5
"""Bead widths from which a line counts where it is looked whether fewer would do."""
CRUMB = 0.02
"""Area, in squares of the bead's width, up to which a gap does not count where patterns are compared."""


Pattern = Literal["zigzag", "contour", "spiral", "offset-zigzag"]


class Style(NamedTuple):
    """``is_along``: a long region has its rows along it, whatever their angle is. ``start``: the direction in radians
    in which rings start, seen from their middle; that of a long region lies along it."""

    is_along: bool = True
    start: float = 0.0


def weave_piece(region: Any, pattern: Pattern, bead: Bead, angle: float, style: Style, free: Any) -> list[Line]:
    """Lines of a pattern whose beads cover a connected region, as few and short as may be.

    ``angle`` of the rows in radians; a zigzag that is to keep to it is no spiral. ``free``: where the middles of beads
    may lie, None for everywhere. A zigzag is rows, rows within a ring, or a spiral, whichever has the fewest passes,
    the shortest way and the smallest gaps.
    """
    width, start = bead.width, style.start
    if _measure_aspect(region) > LONG:
        main = find_main_angle(region)
        angle = main if style.is_along else angle
        # at the end where a line in the middle ends too
        start = main if np.cos(start - main) > 0 else main + np.pi
    inner = soften(shift_border(region, -width / 2), free, width)
    tries: list[list[Line]] = []
    if pattern == "zigzag":
        tries.append([Line(row, "row") for row in fill_with_rows(region, bead, angle, True, free)])
    if inner.is_empty():
        tries.append(draw_thin(region, bead, free))
    else:
        ahead = np.array([np.cos(start), np.sin(start)])
        thin = [
            line
            for piece in list_pieces(region - shift_border(inner, 0.51 * width))
            if piece.area() > THIN * width**2
            for line in draw_thin(piece, bead, free)
        ]
        if pattern == "contour":
            rings, middles = list_levels(inner, bead)
            tries.append([*thin, *[Line(close_ring(start_farthest(ring, ahead)), "ring") for ring in rings], *middles])
        if pattern == "spiral" or (pattern == "zigzag" and style.is_along):
            tries.append([*thin, *draw_spiral(inner, bead, ahead)])
        if pattern in ("zigzag", "offset-zigzag"):
            rings = [start_farthest(ring, ahead) for ring in read_rings(inner, bead)]
            within = shift_border(shift_border(inner, -NEARER * bead.step), width / 2)
            rows = [] if within.is_empty() else fill_with_rows(within, bead, angle, True, inner)
            tries.append(
                [*thin, *[Line(close_ring(ring), "ring") for ring in rings], *[Line(row, "row") for row in rows]]
            )
    link = shift_border(inner, INSIDE * width) if free is None else free
    if free is None and inner.is_empty():
        link = None
    found = [part_lines(join_all(lines, link, bead), bead) for lines in tries]
    best = min(found, key=lambda lines: estimate(lines, region, bead))
    is_free = pattern == "spiral" or (pattern == "zigzag" and style.is_along)
    if inner.is_empty() or not is_free or _count_long(best, width) == 1:
        return best
    merged = part_lines(join_all([*thin, *draw_one(inner, bead, ahead)], link, bead), bead)
    if _count_long(merged, width) >= _count_long(best, width):
        return best
    return min(best, merged, key=lambda lines: estimate(lines, region, bead))


def _count_long(lines: Sequence[Line], width: float) -> int:
    return sum(measure_length(line.points) > SCRAP * width for line in lines)


def part_lines(lines: Sequence[Line], bead: Bead) -> list[Line]:
    """The lines, each ended where it would come back on itself."""
    return [Line(piece, line.kind) for line in lines for piece in end_at_reversals(line.points, bead.width)]


def join_all(lines: Sequence[Line], within: Any, bead: Bead) -> list[Line]:
    """The lines, joined where their ends are near; a joined one is what most of it is."""
    # a place has no direction in which it could be joined
    places = [line for line in lines if measure_length(line.points) <= 1e-6 * bead.width]
    lines = [line for line in lines if measure_length(line.points) > 1e-6 * bead.width]
    joined = join_ends([line.points for line in lines], within, bead.width)
    long = [measure_length(line.points) for line in lines]
    return [*[Line(points, lines[max(numbers, key=lambda k: long[k])].kind) for points, numbers in joined], *places]


def _measure_aspect(region: Any) -> float:
    outline = turn_points(np.concatenate([np.asarray(ring) for ring in region.to_polygons()]), -find_main_angle(region))
    long, short = np.ptp(outline, axis=0)
    return float(long / max(short, 1e-300))


def estimate(lines: Sequence[Line], region: Any, bead: Bead) -> float:
    """The way along the lines and between them, and what they miss, in bead widths."""
    missed = region - cover([line.points for line in lines], bead.width)
    areas = [float(piece.area()) / bead.width**2 for piece in list_pieces(missed)]
    area = sum(each for each in areas if each > CRUMB)
    way = sum(measure_length(line.points) for line in lines) / bead.width
    return WAY * len(lines) + way + MISSED * area
