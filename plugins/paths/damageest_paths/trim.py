"""Cuts lines where the middle of a bead may not lie, and lengthens those that are shorter than a pass may be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.regions import cover, is_within, measure_length, resample, shift_border

FINE = 0.05
"""Distance, in bead widths, of the places of a line at which it is looked whether it may be there."""
MORE = 0.05
"""Area, in squares of the bead's width, that a pass may cover outside of a region because it was lengthened."""
NEAR = 0.9
"""Share of half a bead's width within which a ring lies beside a gap."""
JOIN = 1.0
"""Bead widths round gaps by which what lies between them is bridged: a few long passes for many short ones."""
APART = 1e-12
"""Product of areas below which two sides only touch."""
LINK = 1.5
"""Bead widths between the ends of two lines up to which they become one pass."""


def trim_line(line: Floats, free: Any, width: float) -> list[Floats]:
    """The pieces (K,2) of a polyline (N,2) that lie in the region ``free``; ``width`` of a bead."""
    points, corner = resample(line, FINE * width)
    inside = is_within(points, free)
    if inside.all():
        return [line]
    edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
    pieces = []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        kept = np.flatnonzero(corner[start:stop] >= 0)
        kept = np.unique(np.concatenate([[0], kept, [stop - start - 1]])) + start
        if len(kept) > 1:
            pieces.append(points[kept])
    return pieces


def lengthen_line(line: Floats, shortest: float, region: Any, free: Any, width: float) -> Floats:
    """A line (2,2) that is shorter than a pass may be, made that long about its middle; the line as it is where its
    bead would then cover much outside of the region, or its ends would not lie in ``free``, None for everywhere."""
    length = measure_length(line)
    if len(line) != 2 or length >= shortest or length <= 0:
        return line
    middle, along = line.mean(axis=0), (line[1] - line[0]) / length
    half = 0.5 * shortest * (1 + 1e-9) * along
    longer = np.array([middle - half, middle + half])
    if free is not None and not is_within(longer, free).all():
        return line
    outside = float((cover([longer], width) - region).area() - (cover([line], width) - region).area())
    return longer if outside <= MORE * width**2 else line


def follow_rim(rings: Sequence[Floats], gaps: Any, width: float) -> list[Floats]:
    """The pieces of closed rings (K,2) whose beads lie beside gaps, a region."""
    near = shift_border(shift_border(gaps, width / 2 * NEAR + JOIN * width), -JOIN * width)
    return [piece for ring in rings for piece in cut_ring(ring, near, width)]


def cut_ring(ring: Floats, region: Any, width: float) -> list[Floats]:
    """The pieces of a closed ring (K,2) that lie in a region; the whole ring, closed, where all of it does."""
    closed = np.concatenate([ring, ring[:1]])
    points, _ = resample(closed, FINE * width)
    out = np.flatnonzero(~is_within(points, region))
    if len(out):  # begins outside, so that no piece is cut in two
        closed = np.concatenate([points[out[0] : -1], points[: out[0] + 1]])
    return trim_line(closed, region, width)


def join_lines(lines: Sequence[Floats], free: Any, width: float) -> list[Floats]:
    """The polylines (K,2), joined end to end where the ends are not farther apart than ``LINK`` bead widths and the
    straight way between them lies in the region ``free``. A closed one begins where it is nearest to an end of
    another. The shortest ways are taken first; a joined line crosses itself nowhere."""
    left = list(lines)
    while len(left) > 1:
        found = [
            way for k in range(len(left)) for n in range(len(left)) if k != n for way in _list_links(left, k, n, width)
        ]
        for _, first, second, pair in sorted(found, key=lambda way: way[:3]):
            start, stop = pair
            link, _ = resample(np.array([start[-1], stop[0]]), FINE * width)
            ends = np.array([start[-1], stop[0]])
            if crosses(start, stop) or crosses(ends, start[:-1]) or crosses(ends, stop[1:]):
                continue
            if is_within(link[1:-1], free).all():
                left = [line for k, line in enumerate(left) if k not in (first, second)]
                left.append(np.concatenate([start, stop]))
                break
        else:
            break
    return left


def _list_links(
    lines: Sequence[Floats], first: int, second: int, width: float
) -> list[tuple[float, int, int, tuple[Floats, Floats]]]:
    """The ways from a line to an open one that are short enough: length, the two numbers, and both as they are run."""
    one, other = lines[first], lines[second]
    if is_closed(other) or (first > second and not is_closed(one)):
        return []
    found = []
    for stop in (other, other[::-1]):
        if is_closed(one):
            nearest = int(np.argmin(np.linalg.norm(one[:-1] - stop[0], axis=1)))
            turned = np.roll(one[:-1], -nearest, axis=0)
            starts = [np.concatenate([turned, turned[:1]])]
        else:
            starts = [one, one[::-1]]
        for start in starts:
            far = float(np.linalg.norm(start[-1] - stop[0]))
            if far <= LINK * width:
                found.append((far, first, second, (start, stop)))
    return found


def crosses(line: Floats, other: Floats) -> bool:
    """Whether a side of one polyline (K,2) properly crosses a side of another (M,2)."""
    a, b, c, d = line[:-1, None], line[1:, None], other[None, :-1], other[None, 1:]

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        return np.asarray((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])

    across = (side(a, b, c) * side(a, b, d) < -APART) & (side(c, d, a) * side(c, d, b) < -APART)
    return bool(across.any())


def is_closed(line: Floats) -> bool:
    """Whether a polyline (K,2) ends where it begins."""
    if len(line) <= 3:
        return False
    # numpy.allclose takes most of the time where many lines are compared
    (a, b), (c, d) = line[0].tolist(), line[-1].tolist()
    return bool(max(abs(a - c), abs(b - d)) <= 1e-8 + 1e-5 * min(abs(c), abs(d)))
