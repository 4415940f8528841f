"""Cuts lines where the middle of a bead may not lie, and lengthens those that are shorter than a pass may be."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.regions import cover, find_runs, is_within, measure_length, resample

FINE = 0.05
"""Distance, in bead widths, of the places of a line at which it is looked whether it may be there."""
MORE = 0.05
"""Area, in squares of the bead's width, that a pass may cover outside of a region because it was lengthened."""
APART = 1e-12
"""Product of areas below which two sides only touch."""


def trim_line(line: Floats, free: Any, width: float) -> list[Floats]:
    """The pieces (K,2) of a polyline (N,2) that lie in the region ``free``; ``width`` of a bead."""
    points, corner = resample(line, FINE * width)
    inside = is_within(points, free)
    if inside.all():
        return [line]
    pieces = []
    for start, stop in find_runs(inside):
        kept = np.flatnonzero(corner[start:stop] >= 0)
        kept = np.unique(np.concatenate([[0], kept, [stop - start - 1]])) + start
        if len(kept) > 1:
            pieces.append(points[kept])
    return pieces


def lengthen_line(line: Floats, shortest: float, region: Any, free: Any, width: float) -> Floats:
    """A line (K,2) that is shorter than a pass may be, made straight and that long about its middle; the line as it is
    where its bead would then cover much outside of the region, or its ends would not lie in ``free``, None for
    everywhere."""
    ends = line[[0, -1]]
    length = measure_length(ends)
    if measure_length(line) >= shortest or length <= 0:
        return line
    middle, along = ends.mean(axis=0), (ends[1] - ends[0]) / length
    half = 0.5 * shortest * (1 + 1e-9) * along
    longer = np.array([middle - half, middle + half])
    if free is not None and not is_within(longer, free).all():
        return line
    outside = float((cover([longer], width) - region).area() - (cover([line], width) - region).area())
    return longer if outside <= MORE * width**2 else line


def cut_ring(ring: Floats, region: Any, width: float) -> list[Floats]:
    """The pieces of a closed ring (K,2) that lie in a region; the whole ring, closed, where all of it does."""
    closed = np.concatenate([ring, ring[:1]])
    points, _ = resample(closed, FINE * width)
    out = np.flatnonzero(~is_within(points, region))
    if len(out):  # begins outside, so that no piece is cut in two
        closed = np.concatenate([points[out[0] : -1], points[: out[0] + 1]])
    return trim_line(closed, region, width)


def crosses(line: Floats, other: Floats) -> bool:
    """Whether a side of one polyline (K,2) properly crosses a side of another (M,2)."""
    if min(len(line), len(other)) < 2:
        return False
    first, second = _keep_near(line, other), _keep_near(other, line)
    a, b = first[:, None, 0], first[:, None, 1]
    c, d = second[None, :, 0], second[None, :, 1]

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        return np.asarray((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])

    across = (side(a, b, c) * side(a, b, d) < -APART) & (side(c, d, a) * side(c, d, b) < -APART)
    return bool(across.any())


def _keep_near(line: Floats, other: Floats) -> Floats:
    """(S,2,2) the sides of a polyline (K,2) whose boxes reach into the box of another."""
    sides = np.stack([line[:-1], line[1:]], axis=1)
    near = (sides.min(axis=1) <= other.max(axis=0)) & (sides.max(axis=1) >= other.min(axis=0))
    return np.asarray(sides[near.all(axis=1)])


def is_closed(line: Floats) -> bool:
    """Whether a polyline (K,2) ends where it begins."""
    if len(line) <= 3:
        return False
    # numpy.allclose takes most of the time where many lines are compared
    (a, b), (c, d) = line[0].tolist(), line[-1].tolist()
    return bool(max(abs(a - c), abs(b - d)) <= 1e-8 + 1e-5 * min(abs(c), abs(d)))
