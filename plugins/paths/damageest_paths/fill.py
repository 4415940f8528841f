"""Patterns that fill a layer: polylines whose beads cover it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.regions import cover, find_main_angle, list_pieces, measure_length, shift_border, unite_regions
from damageest_paths.stripes import Bead, fill_with_rows
from damageest_paths.trim import cut_ring, follow_rim, join_lines, lengthen_line, trim_line

Pattern = Literal["zigzag", "contour", "spiral", "offset-zigzag"]
Kind = Literal["row", "ring", "spiral", "rim", "gap"]
"""What a pass is: a row or rows to and fro, a ring, rings that are linked, a piece of the outermost ring beside
rows, or a row in a gap between others."""

SLIVER = 0.04
"""Area of a gap, in squares of the bead's width, from which it gets a pass of its own."""
FINE_SLIVER = 0.01
"""The same beside which a piece of the outermost ring is laid: the ends of rows leave many of them along a rim."""
WAY = 6.0
"""Bead widths of travel that a pass more costs, where a ring beside rows is compared with pieces of it."""
NEARER = 0.85
"""Share of a step from a ring to the border of the rows within it: their ends are round."""
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


class Line(NamedTuple):
    """The middle line of a pass (K,2), and what it is."""

    points: Floats
    kind: Kind


def fill_region(region: Any, pattern: Pattern, bead: Bead, angle: float) -> list[Floats]:
    """Polylines (K,2) whose beads cover a region. ``angle`` in radians: of the rows of a zigzag."""
    return [line.points for line in list_lines(region, pattern, bead, angle)]


def list_lines(
    region: Any,
    pattern: Pattern,
    bead: Bead,
    angle: float,
    free: Any = None,
    shortest: float = 0.0,
    firm: Any = None,
) -> list[Line]:
    """Lines whose beads cover a region, as far as their middles may lie in the region ``free``, None for everywhere.

    ``shortest``: lines that are shorter are lengthened where there is room; the others are given as they are. ``firm``:
    where lines that follow the border of the free region may lie beside the region too; None: nowhere.
    """
    if region.is_empty():
        return []
    if pattern == "zigzag" and free is not None:
        pieces = sorted(list_pieces(region), key=lambda each: each.bounds())
        lines = [line for piece in pieces for line in _fill_piece(piece, bead, angle, free, shortest)]
    else:
        fill = {
            "zigzag": _fill_zigzag, "contour": _fill_contour, "spiral": _fill_spiral, "offset-zigzag": _fill_both
        }  # fmt: skip
        lines = _finish(fill[pattern](region, bead, angle), region, bead, free, shortest)
        if free is not None:
            lines += _fill_rim(region, lines, bead, free, shortest)
    for _ in range(ROUNDS):
        gaps = _list_gaps(region, lines, bead)
        rows = [row for gap in gaps for row in fill_with_rows(gap, bead, find_main_angle(gap), linked=False)]
        if not rows:
            break
        lines += _finish([Line(row, "gap") for row in rows], region, bead, free, shortest)
    return lines if free is None else [*lines, *_fill_beside(region, lines, bead, free, shortest, firm)]


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


def _fill_piece(region: Any, bead: Bead, angle: float, free: Any, shortest: float) -> list[Line]:
    """Rows, and what of the outermost ring they need beside them; or all of that ring, and rows within it. That with
    the fewer and shorter passes is taken: many short pieces of the ring cost more travel than the whole of it."""
    rows = [Line(row, "row") for row in fill_with_rows(region, bead, angle, True, free)]
    rows = _finish(rows, region, bead, free, shortest)
    rim = _fill_rim(region, rows, bead, free, shortest)
    if not rim:
        return rows
    plain = _join([*rows, *rim], free, bead)
    rings = _read_rings(shift_border(region, -bead.width / 2), bead)
    border = [Line(piece, "rim") for ring in rings for piece in cut_ring(ring, free, bead.width)]
    inner = shift_border(shift_border(region, -bead.width / 2 - NEARER * bead.step), bead.width / 2)
    rows_within = [] if inner.is_empty() else fill_with_rows(inner, bead, angle, True, free)
    within = [Line(row, "row") for row in rows_within]
    ringed = _join(_finish([*border, *within], region, bead, free, shortest), free, bead)
    missed = [_measure_gaps(region, lines, bead) for lines in (plain, ringed)]
    if not border or missed[1] > missed[0] + SLIVER * bead.width**2:
        return plain
    return min(plain, ringed, key=lambda lines: _estimate(lines, bead))


def _fill_rim(region: Any, lines: Sequence[Line], bead: Bead, free: Any, shortest: float) -> list[Line]:
    """The pieces of the outermost ring that lie beside gaps which the lines leave."""
    gaps = _list_gaps(region, lines, bead, FINE_SLIVER)
    rings = _read_rings(shift_border(region, -bead.width / 2), bead) if gaps else []
    rim = [Line(piece, "rim") for piece in follow_rim(rings, unite_regions(gaps), bead.width)]
    return _finish(rim, region, bead, free, shortest)


def _join(lines: Sequence[Line], free: Any, bead: Bead) -> list[Line]:
    """The lines, joined where their ends meet; what has a piece of a ring and rows is of kind row."""
    rows = [line.points for line in lines if line.kind == "row"]
    joined = join_lines([line.points for line in lines], free, bead.width)
    ends = {tuple(point) for row in rows for point in row.tolist()}
    return [Line(line, "row" if any(tuple(point) in ends for point in line.tolist()) else "rim") for line in joined]


def _estimate(lines: Sequence[Line], bead: Bead) -> float:
    """The way along the lines and between them, in bead widths."""
    return WAY * len(lines) + sum(measure_length(line.points) for line in lines) / bead.width


def _measure_gaps(region: Any, lines: Sequence[Line], bead: Bead) -> float:
    """The area of the gaps worth a piece of the ring."""
    return float(sum(gap.area() for gap in _list_gaps(region, lines, bead, FINE_SLIVER)))


def _finish(lines: Sequence[Line], region: Any, bead: Bead, free: Any, shortest: float) -> list[Line]:
    """The lines, trimmed and lengthened."""
    pieces = [
        Line(piece, line.kind)
        for line in lines
        for piece in ([line.points] if free is None else trim_line(line.points, free, bead.width))
    ]
    return [Line(lengthen_line(line.points, shortest, region, free, bead.width), line.kind) for line in pieces]


def _list_gaps(region: Any, lines: Sequence[Line], bead: Bead, least: float = SLIVER) -> list[Any]:
    """What the beads leave of a region, without what is smaller than ``least`` squares of the bead's width."""
    gaps = region - cover([line.points for line in lines], bead.width)
    large = [gap for gap in list_pieces(gaps) if gap.area() > least * bead.width**2]
    return sorted(large, key=lambda gap: gap.bounds())


def _fill_zigzag(region: Any, bead: Bead, angle: float) -> list[Line]:
    return [Line(row, "row") for row in fill_with_rows(region, bead, angle)]


def _fill_contour(region: Any, bead: Bead, angle: float) -> list[Line]:
    return [Line(_close(ring), "ring") for ring in _find_rings(region, bead)]


def _fill_both(region: Any, bead: Bead, angle: float) -> list[Line]:
    rings = shift_border(region, -bead.width / 2)
    outer = [Line(_close(ring), "ring") for ring in _read_rings(rings, bead)]
    inner = shift_border(shift_border(region, -bead.width / 2 - bead.step), bead.width / 2) if outer else region
    return [*outer, *(_fill_zigzag(inner, bead, angle) if not inner.is_empty() else [])]


def _fill_spiral(region: Any, bead: Bead, angle: float) -> list[Line]:
    """Rings, each linked with the one inside it: it ends a step before it closes, and goes on at the nearest point."""
    rings = _find_rings(region, bead)
    lines: list[Line] = []
    while rings:
        line = rings.pop(0)
        closed = True
        while True:
            found = _find_inner(line[-1] if not closed else line, rings, bead) if rings else None
            if found is None:
                break
            number, corner = found
            ring = rings.pop(number)
            if closed:
                start = int(np.argmin(np.linalg.norm(line - ring[corner], axis=1)))
                line = _open(np.roll(line, -start, axis=0), bead.step)
                corner = int(np.argmin(np.linalg.norm(ring - line[-1], axis=1)))
                closed = False
            line = np.concatenate([line, _open(np.roll(ring, -corner, axis=0), bead.step)])
        lines.append(Line(_close(line) if closed else line, "spiral"))
    return lines


def _find_inner(end: Floats, rings: Sequence[Floats], bead: Bead) -> tuple[int, int] | None:
    """The ring that passes a point (2,) or a ring (K,2) by not much more than a step, and its nearest corner."""
    ends = np.atleast_2d(end)
    gaps = [np.linalg.norm(ring[:, None] - ends[None], axis=2).min(axis=1) for ring in rings]
    number = int(np.argmin([gap.min() for gap in gaps]))
    return (number, int(gaps[number].argmin())) if gaps[number].min() <= 1.5 * bead.step else None


def _find_rings(region: Any, bead: Bead) -> list[Floats]:
    """Closed rings (K,2), without the first corner again, from outside to inside."""
    rings: list[Floats] = []
    inside = shift_border(region, -bead.width / 2)
    while not inside.is_empty():
        rings += _read_rings(inside, bead)
        inside = shift_border(inside, -bead.step)
    return rings


def _read_rings(region: Any, bead: Bead, off: float = 0.01) -> list[Floats]:
    """The outlines of a region as rings with corners not farther apart than the bead's width; they are up to ``off``
    bead widths beside the outlines."""
    polygons = region.simplify(off * bead.width).to_polygons()
    rings = [np.asarray(ring, dtype=np.float64) for ring in polygons]
    return [_refine(ring, bead.width) for ring in rings if len(ring) > 2 and measure_length(_close(ring)) > bead.width]


def _read_border(region: Any, within: float, bead: Bead) -> list[Floats]:
    """The outlines of a region, shrunk by ``within`` bead widths, as rings that do not leave it."""
    return _read_rings(shift_border(region, -within * bead.width), bead, within / 2)


def _refine(ring: Floats, longest: float) -> Floats:
    """A ring with more corners, so that none is farther than ``longest`` from the next."""
    sides = np.roll(ring, -1, axis=0) - ring
    counts = np.maximum(np.ceil(np.linalg.norm(sides, axis=1) / longest).astype(int), 1)
    share = np.concatenate([np.arange(count) / count for count in counts])
    return np.asarray(np.repeat(ring, counts, axis=0) + share[:, None] * np.repeat(sides, counts, axis=0))


def _close(ring: Floats) -> Floats:
    return np.concatenate([ring, ring[:1]])


def _open(ring: Floats, gap: float) -> Floats:
    """A ring as a line that ends ``gap`` before it closes; all of a ring that is short."""
    line = _close(ring)
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    stop = max(at[-1] - gap, at[-1] / 2)
    kept = at < stop
    end = np.array([np.interp(stop, at, line[:, k]) for k in range(2)])
    return np.concatenate([line[kept], end[None]])
