"""Cuts lines where the middle of a bead may not lie, and lengthens those that are shorter than a pass may be."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.regions import cover, is_within, measure_length, resample
from damageest_paths.stripes import Bead

FINE = 0.05
"""Distance, in bead widths, of the places of a line at which it is looked whether it may be there."""
MORE = 0.05
"""Area, in squares of the bead's width, that a pass may cover outside of a region because it was lengthened."""


def trim_line(line: Floats, free: Any, bead: Bead) -> list[Floats]:
    """The pieces (K,2) of a polyline (N,2) that lie in the region ``free``."""
    points, corner = resample(line, FINE * bead.width)
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


def lengthen_line(line: Floats, shortest: float, region: Any, free: Any, bead: Bead) -> Floats:
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
    outside = float((cover([longer], bead.width) - region).area() - (cover([line], bead.width) - region).area())
    return longer if outside <= MORE * bead.width**2 else line
