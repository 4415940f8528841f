"""Patterns that fill a layer: polylines whose beads cover it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.joints import round_corners
from damageest_paths.fill.lines import Line
from damageest_paths.fill.middles import move_inside
from damageest_paths.fill.regions import (
    SAME,
    close_ring,
    cover,
    find_main_angle,
    list_pieces,
    measure_length,
    shift_border,
    thin_line,
    unite_regions,
)
from damageest_paths.fill.stripes import Bead, fill_with_rows
from damageest_paths.fill.trim import cut_ring, lengthen_line
from damageest_paths.fill.weave import Pattern, Style, join_all, part_lines, weave_piece

STYLE = Style()
SLIVER = 0.04
"""Area of a gap, in squares of the bead's width, from which it gets a line."""
NARROW = 0.06
"""Bead widths up to which a gap is too narrow for a line: the melt closes it."""
WORTH, SLIM = 0.1, 0.08
"""Area in squares of the bead's width, and width in bead widths, that a pass has to cover which no other does."""
BESIDE = 0.9
"""Share of half a bead's width within which a line that follows the border of the free region lies beside a gap."""
WITHIN, CLOSE = 0.02, 0.002
"""Bead widths that such a line lies within that border. Where none covers the gap: one that is closer, as far beside
what it may lie on."""
DOUBLED, SHARP = 0.75, np.radians(60.0)
"""Share of its length times the bead's width that a line covers at most where it comes back beside itself, and the turn
at a corner at which it is cut there."""
ROUNDS = 2
"""How often gaps between passes are looked for and filled."""


def fill_region(region: Any, pattern: Pattern, bead: Bead, angle: float) -> list[Floats]:
    """Polylines (K,2) whose beads cover a region. ``angle`` in radians: of the rows of a zigzag."""
    return [line.points for line in list_lines(region, pattern, bead, angle, style=Style(is_along=False))]


def list_lines(
    region: Any,
    pattern: Pattern,
    bead: Bead,
    angle: float,
    free: Any = None,
    shortest: float = 0.0,
    firm: Any = None,
    style: Style = STYLE,
) -> list[Line]:
    """Lines whose beads cover a region, as far as their middles may lie in the region ``free``, None for everywhere.

    ``shortest``: lines that are shorter are lengthened where there is room; the others are given as they are. ``firm``:
    where lines that follow the border of the free region may lie beside the region too; None: nowhere.
    """
    if region.is_empty():
        return []
    pieces = sorted(list_pieces(region), key=lambda each: each.bounds())
    woven = [line for piece in pieces for line in weave_piece(piece, pattern, bead, angle, style, free)]
    lines = _finish(woven, region, bead, free, shortest)
    for _ in range(ROUNDS):
        gaps = _list_gaps(region, lines, bead)
        rows = [row for gap in gaps for row in fill_with_rows(gap, bead, find_main_angle(gap), linked=False)]
        if not rows:
            break
        lines += _finish([Line(row, "gap") for row in rows], region, bead, free, shortest)
    if free is not None:
        lines += _fill_beside(region, lines, bead, free, shortest, firm)
    within = shift_border(region, -bead.width / 4) if free is None else free
    tidy = _tidy(lines, region, within, bead)
    return [Line(lengthen_line(line.points, shortest, region, free, bead.width), line.kind) for line in tidy]


def _tidy(lines: Sequence[Line], region: Any, within: Any, bead: Bead) -> list[Line]:
    """The lines, joined, without reversals and those that hardly cover what no other does, their corners round."""
    width = bead.width
    found = part_lines(join_all(lines, within, bead), bead)
    covered = [cover([line.points], width) ^ region for line in found]
    for k in sorted(range(len(found)), key=lambda k: measure_length(found[k].points)):
        others = [one for n, one in enumerate(covered) if n != k and not one.is_empty()]
        own = covered[k] - unite_regions(others)
        if others and (own.area() < WORTH * width**2 or shift_border(own, -SLIM / 2 * width).is_empty()):
            covered[k] -= covered[k]
    found = [line for line, own in zip(found, covered, strict=True) if not own.is_empty()]
    round_ = [Line(round_corners(line.points, width), line.kind) for line in found]
    return [Line(thin_line(line.points, SAME * width), line.kind) for line in part_lines(round_, bead)]


def _fill_beside(region: Any, lines: Sequence[Line], bead: Bead, free: Any, shortest: float, firm: Any) -> list[Line]:
    """Pieces of the border of the free region that cover gaps in which no row may lie: tips of the region beside metal.
    Of pieces that cover the same the one that covers most is taken."""
    gaps = _list_gaps(region, lines, bead)
    if not gaps:
        return []
    held = region if firm is None else unite_regions([region, firm])
    wide = free ^ shift_border(held, WITHIN * bead.width)
    borders = [_read_border(free ^ held, WITHIN, bead), _read_border(wide, CLOSE, bead)]
    covered = shift_border(cover([line.points for line in lines], bead.width), WITHIN * bead.width)
    found: list[Line] = []
    for gap in gaps:
        rest = gap
        # next to what is covered, tips and strips along a hole may be too narrow for WITHIN; a strip alone is left out
        for rings in borders[:1] if (gap ^ covered).is_empty() else borders:
            near = shift_border(rest, bead.width / 2 * BESIDE)
            pieces = [piece for ring in rings for piece in cut_ring(ring, near, bead.width)]
            parts = [Line(part, "gap") for piece in pieces for part in _split_doubled(piece, bead)]
            chosen = _choose_most(_finish(parts, region, bead, free, shortest), rest, bead)
            rest -= cover([line.points for line in chosen], bead.width)
            found += chosen
    return found


def _choose_most(lines: Sequence[Line], gap: Any, bead: Bead) -> list[Line]:
    """The lines that cover a gap: the one that covers most, then the one that covers most of the rest, and so on."""
    left, chosen = list(lines), list[Line]()
    while left:
        gains = [float((gap ^ cover([line.points], bead.width)).area()) for line in left]
        best = int(np.argmax(np.round(gains, 9)))
        if gains[best] <= SLIVER * bead.width**2:
            break
        chosen.append(left.pop(best))
        gap = gap - cover([chosen[-1].points], bead.width)
    return chosen


def _split_doubled(line: Floats, bead: Bead) -> list[Floats]:
    """The line, or its pieces between sharp corners where it comes back beside itself: the border of a narrow region
    runs along both of its sides, and a bead on one of them is enough."""
    if float(cover([line], bead.width).area()) > DOUBLED * measure_length(line) * bead.width:
        return [line]
    sides = np.diff(line, axis=0)
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    turns = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi)
    ends = [0, *(np.flatnonzero(turns > SHARP) + 1).tolist(), len(line) - 1]
    return [line[start : stop + 1] for start, stop in pairwise(ends)]


def _finish(lines: Sequence[Line], region: Any, bead: Bead, free: Any, shortest: float) -> list[Line]:
    """The lines, trimmed and lengthened."""
    pieces = [
        Line(piece, line.kind)
        for line in lines
        for piece in ([line.points] if free is None else move_inside(line.points, free, bead.width))
    ]
    return [Line(lengthen_line(line.points, shortest, region, free, bead.width), line.kind) for line in pieces]


def _list_gaps(region: Any, lines: Sequence[Line], bead: Bead) -> list[Any]:
    """What the beads leave of a region, without what is narrow or small."""
    gaps = region - cover([line.points for line in lines], bead.width)
    half = NARROW / 2 * bead.width
    wide = shift_border(shift_border(gaps, -half), half)
    large = [gap for gap in list_pieces(wide) if gap.area() > SLIVER * bead.width**2]
    return sorted(large, key=lambda gap: gap.bounds())


def _read_rings(region: Any, bead: Bead, off: float = 0.01) -> list[Floats]:
    """The outlines of a region as rings with corners not farther apart than the bead's width; they are up to ``off``
    bead widths beside the outlines."""
    polygons = region.simplify(off * bead.width).to_polygons()
    rings = [np.asarray(ring, dtype=np.float64) for ring in polygons]
    return [
        _refine(ring, bead.width) for ring in rings if len(ring) > 2 and measure_length(close_ring(ring)) > bead.width
    ]


def _read_border(region: Any, within: float, bead: Bead) -> list[Floats]:
    """The outlines of a region, shrunk by ``within`` bead widths, as rings that do not leave it."""
    return _read_rings(shift_border(region, -within * bead.width), bead, within / 2)


def _refine(ring: Floats, longest: float) -> Floats:
    """A ring with more corners, so that none is farther than ``longest`` from the next."""
    sides = np.roll(ring, -1, axis=0) - ring
    counts = np.maximum(np.ceil(np.linalg.norm(sides, axis=1) / longest).astype(int), 1)
    share = np.concatenate([np.arange(count) / count for count in counts])
    return np.asarray(np.repeat(ring, counts, axis=0) + share[:, None] * np.repeat(sides, counts, axis=0))
