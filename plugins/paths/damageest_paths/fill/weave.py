"""Fills a region with few long passes: a ring along its border, and rows along its long axis within, or a spiral."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.joints import end_at_reversals, join_ends, open_ring
from damageest_paths.fill.regions import (
    close_ring,
    cover,
    drop_narrow,
    find_main_angle,
    is_within,
    list_pieces,
    measure_length,
    resample,
    shift_border,
    turn_points,
)
from damageest_paths.fill.stripes import Bead, fill_with_rows
from damageest_paths.fill.trim import trim_line

LONG = 1.6
"""Length over width of the rectangle round a piece from which its rows run along it in every layer."""
SOFT = 0.14
"""Radius in bead widths of the corners of a ring, within which the border of a region is smoothed too."""
INSIDE = 0.004
"""Bead widths that a ring keeps from where no bead may lie."""
NEARER = 0.85
"""Share of a step from a ring to the border of the rows within it: their ends are round."""
THIN = 0.08
"""Area, in squares of the bead's width, of what a ring does not cover of a thin piece, from which it gets a line."""
NEAR = 0.2
"""Bead widths by which a line is moved to where a bead may lie; what is farther off is cut."""
WAY, MISSED = 8.0, 6.0
"""Bead widths of way that a pass more costs, and a square of the bead's width that stays without a bead."""
NEXT = 1.5
"""Steps from the end of a ring to the next one inside it, at most."""
CRUMB = 0.02
"""Area, in squares of the bead's width, up to which a gap does not count where patterns are compared."""
STATION = 0.25
"""Bead widths between the places at which the middle of a thin piece is taken."""


Pattern = Literal["zigzag", "contour", "spiral", "offset-zigzag"]
Kind = Literal["row", "ring", "spiral", "rim", "gap"]
"""What a pass is: a row or rows to and fro, a ring, rings that are linked, a piece of the outermost ring beside
rows, or a row in a gap between others."""


class Line(NamedTuple):
    """The middle line of a pass (K,2), and what it is."""

    points: Floats
    kind: Kind


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
        tries.append(_draw_thin(region, bead, free))
    else:
        ahead = np.array([np.cos(start), np.sin(start)])
        thin = [
            line
            for piece in list_pieces(region - shift_border(inner, 0.51 * width))
            if piece.area() > THIN * width**2
            for line in _draw_thin(piece, bead, free)
        ]
        if pattern == "contour":
            rings, middles = _list_levels(inner, bead)
            tries.append([*thin, *[Line(close_ring(_start_at(ring, ahead)), "ring") for ring in rings], *middles])
        if pattern == "spiral" or (pattern == "zigzag" and style.is_along):
            tries.append([*thin, *_draw_spiral(inner, bead, ahead)])
        if pattern in ("zigzag", "offset-zigzag"):
            rings = [_start_at(ring, ahead) for ring in read_rings(inner, bead)]
            within = shift_border(shift_border(inner, -NEARER * bead.step), width / 2)
            rows = [] if within.is_empty() else fill_with_rows(within, bead, angle, True, inner)
            tries.append(
                [*thin, *[Line(close_ring(ring), "ring") for ring in rings], *[Line(row, "row") for row in rows]]
            )
    link = shift_border(inner, INSIDE * width) if free is None else free
    if free is None and inner.is_empty():
        link = None
    found = [part_lines(join_all(lines, link, bead), bead) for lines in tries]
    return min(found, key=lambda lines: _estimate(lines, region, bead))


def part_lines(lines: Sequence[Line], bead: Bead) -> list[Line]:
    """The lines, each ended where it would come back on itself."""
    return [Line(piece, line.kind) for line in lines for piece in end_at_reversals(line.points, bead.width)]


def join_all(lines: Sequence[Line], within: Any, bead: Bead) -> list[Line]:
    """The lines, joined where their ends are near; a joined one is what most of it is."""
    joined = join_ends([line.points for line in lines], within, bead.width)
    long = [measure_length(line.points) for line in lines]
    return [Line(points, lines[max(numbers, key=lambda k: long[k])].kind) for points, numbers in joined]


def soften(inner: Any, free: Any, width: float) -> Any:
    """The region with its border smoothed and its corners round, without what is narrower than a ring may be."""
    if free is not None:
        inner = inner ^ free
    closed = shift_border(shift_border(inner, SOFT * width), -SOFT * width)
    if free is not None:
        closed = closed ^ shift_border(free, -INSIDE * width)
    found = drop_narrow(closed, SOFT * width, keeps_corners=True).simplify(INSIDE / 2 * width)
    return found if free is None else found ^ free


def _measure_aspect(region: Any) -> float:
    outline = turn_points(np.concatenate([np.asarray(ring) for ring in region.to_polygons()]), -find_main_angle(region))
    long, short = np.ptp(outline, axis=0)
    return float(long / max(short, 1e-300))


def _estimate(lines: Sequence[Line], region: Any, bead: Bead) -> float:
    """The way along the lines and between them, and what they miss, in bead widths."""
    missed = region - cover([line.points for line in lines], bead.width)
    areas = [float(piece.area()) / bead.width**2 for piece in list_pieces(missed)]
    area = sum(each for each in areas if each > CRUMB)
    way = sum(measure_length(line.points) for line in lines) / bead.width
    return WAY * len(lines) + way + MISSED * area


def _list_levels(inner: Any, bead: Bead) -> tuple[list[Floats], list[Line]]:
    """Rings (K,2) from outside to inside, and the lines in the middle of what is left, where no ring fits."""
    step = _choose_step(inner, bead)
    rings, middles = list[Floats](), list[Line]()
    while not inner.is_empty():
        rings += read_rings(inner, bead)
        shrunk = shift_border(inner, -step)
        # each of the shifts triples the corners of a smooth border
        inner = drop_narrow(shrunk, SOFT / 2 * bead.width, keeps_corners=True).simplify(INSIDE / 2 * bead.width)
        if inner.is_empty() and not shrunk.is_empty():
            middles = [line for piece in list_pieces(shrunk) for line in _draw_middle(piece, bead)]
    return rings, middles


def _choose_step(inner: Any, bead: Bead) -> float:
    """The distance between rings: the bead's, or less where the innermost would else leave a gap too narrow for one."""
    low, high = 0.0, bead.step
    while not shift_border(inner, -high).is_empty():
        low, high = high, 2 * high
    for _ in range(7):
        middle = (low + high) / 2
        low, high = (low, middle) if shift_border(inner, -middle).is_empty() else (middle, high)
    left = low % bead.step
    count = int(np.ceil(low / bead.step))
    return float(bead.step) if left <= 0.48 * bead.width or low < bead.step else float(low / count * 0.995)


def _draw_spiral(inner: Any, bead: Bead, ahead: Floats) -> list[Line]:
    """Rings from outside to inside, each linked with the one inside it: it ends before it closes, and goes on there.
    The first starts where it is farthest in the direction ``ahead`` (2,)."""
    rings, middles = _list_levels(inner, bead)
    rings = [_start_at(ring, ahead) for ring in rings]
    lines: list[Line] = []
    while rings:
        line, is_alone = rings.pop(0), True
        while rings:
            ends = open_ring(line, bead.step)[-1:] if is_alone else line[-1:]
            gaps = [np.linalg.norm(ring[:, None] - ends[None], axis=2).min(axis=1) for ring in rings]
            number = int(np.argmin([gap.min() for gap in gaps]))
            if gaps[number].min() > NEXT * bead.step:
                break
            ring = rings.pop(number)
            if is_alone:
                line = open_ring(line, bead.step)
                is_alone = False
            line = np.concatenate([line, open_ring(_roll(ring, line[-1], line[-1] - line[-2]), bead.step)])
        lines.append(Line(close_ring(line) if is_alone else line, "ring" if is_alone else "spiral"))
    return [*lines, *middles]


def _start_at(ring: Floats, ahead: Floats) -> Floats:
    """A ring (K,2) from its corner on that is farthest in a direction (2,)."""
    return np.roll(ring, -int(np.argmax(np.round((ring - ring.mean(axis=0)) @ ahead, 9))), axis=0)


def _roll(ring: Floats, place: Floats, ahead: Floats | None = None) -> Floats:
    """A ring that begins at its corner nearest to a place (2,), and runs on the way ``ahead`` (2,) if that is given."""
    turned = np.roll(ring, -int(np.argmin(np.linalg.norm(ring - place, axis=1))), axis=0)
    if ahead is not None and (turned[1] - turned[-1]) @ ahead < 0:
        turned = np.roll(turned[::-1], 1, axis=0)
    return turned


def read_rings(region: Any, bead: Bead) -> list[Floats]:
    """The outlines of a region as rings (K,2), without the first corner again, with corners not farther apart than the
    bead's width."""
    rings = [np.asarray(ring, dtype=np.float64) for ring in region.to_polygons()]
    rings = [ring for ring in rings if len(ring) > 2 and measure_length(close_ring(ring)) > bead.width / 2]
    return [resample(close_ring(ring), bead.width / 2)[0][:-1] for ring in rings]


def _draw_thin(region: Any, bead: Bead, free: Any) -> list[Line]:
    """The middle lines of a region narrower than a bead, as far as the middles of beads may lie there."""
    lines = _draw_middle(region, bead)
    if free is None:
        return lines
    return [Line(piece, line.kind) for line in lines for piece in move_inside(line.points, free, bead.width)]


def _draw_middle(region: Any, bead: Bead) -> list[Line]:
    """A line midway between the sides of a region along its long axis; rows where it has branches."""
    from manifold3d import CrossSection

    angle = find_main_angle(region)
    turned = region.rotate(float(-np.degrees(angle)))
    left, low, right, high = turned.bounds()
    count = max(2, int(np.ceil((right - left) / (STATION * bead.width))) + 1)
    inset = min(bead.inset, 0.4 * (right - left))
    stations = np.linspace(left + inset, right - inset, count)
    thick = 1e-3 * bead.width
    middle = []
    for x in stations.tolist():
        strip = CrossSection.square((thick, high - low + 2 * thick)).translate((x - thick / 2, low - thick))
        spans = [piece.bounds() for piece in list_pieces(turned ^ strip)]
        if not spans:
            continue
        bottom, top = min(span[1] for span in spans), max(span[3] for span in spans)
        if top - bottom > 1.3 * bead.width:
            return [Line(row, "row") for row in fill_with_rows(region, bead, angle, True)]
        middle.append((x, (bottom + top) / 2))
    if len(middle) < 2:
        return [Line(row, "row") for row in fill_with_rows(region, bead, angle, True)]
    points = np.array(middle)
    if len(points) > 4:
        smooth = points[:, 1].copy()
        smooth[1:-1] = (points[:-2, 1] + 2 * points[1:-1, 1] + points[2:, 1]) / 4
        points[:, 1] = smooth
    return [Line(turn_points(points, angle), "row")]


def move_inside(line: Floats, free: Any, width: float) -> list[Floats]:
    """The line with its points moved into a region where they are a little beside it; the pieces of it where it is
    farther off."""
    if is_within(line, free).all() and len(trim_line(line, free, width)) == 1:
        return [line]
    points, _ = resample(line, 0.1 * width)
    out = np.flatnonzero(~is_within(points, free))
    target = shift_border(free, -INSIDE * width)
    if not len(out) or target.is_empty():
        return trim_line(line, free, width)
    rings = [np.asarray(ring, dtype=np.float64) for ring in target.to_polygons()]
    start = np.concatenate(rings)
    side = np.concatenate([np.roll(ring, -1, axis=0) - ring for ring in rings])
    away = points[out][:, None] - start
    share = np.clip((away * side).sum(2) / np.maximum((side**2).sum(1), 1e-300), 0, 1)
    foot = start + share[:, :, None] * side
    gap = np.linalg.norm(points[out][:, None] - foot, axis=2)
    best = gap.argmin(axis=1)
    near = gap[np.arange(len(out)), best] <= NEAR * width
    points[out[near]] = foot[np.arange(len(out)), best][near]
    return trim_line(points, free, width)
