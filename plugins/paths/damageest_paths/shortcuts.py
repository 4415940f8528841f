"""Cuts the corners of a way of the tool between passes."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest_paths.clearance import Clearance
from damageest_paths.network import Way, measure_way
from damageest_paths.process import measure_along

PLACES = 32
"""Places along a way, besides its own, between which the tool may go straight."""


def cut_corners(way: Way, clearance: Clearance, gap: float) -> Way:
    """A way that goes straight between places of a clear one, where that is clear; it has the same ends."""
    return _turn_round(_cut_forward(_turn_round(_cut_forward(way, clearance, gap)), clearance, gap))


def _turn_round(way: Way) -> Way:
    return Way(way.points[::-1], way.axes[::-1], way.gap)


def _cut_forward(way: Way, clearance: Clearance, gap: float) -> Way:
    """From each place the tool goes to one of the farthest that it sees, which is found by halving: what lies between
    is not looked at."""
    points, axes = _divide(way)
    kept, least = [0], way.gap
    while kept[-1] < len(points) - 1:
        here = kept[-1]
        near, far, found = here + 1, len(points), way.gap
        middle = far - 1  # the end is tried first
        while far - near > 0 and near != middle:
            own = measure_way(points[[here, middle]], axes[[here, middle]], clearance, gap)
            if own >= gap / 2:
                near, found = middle, own
            else:
                far = middle
            middle = (near + far) // 2
        kept.append(near)
        least = min(least, found)
    return Way(points[kept], axes[kept], least)


def _divide(way: Way) -> tuple[Floats, Floats]:
    """The points (N,3) and axes (N,3) of a way with more places in between, as far apart as each other."""
    along = measure_along(way.points)
    places = np.unique(np.concatenate([along, np.linspace(0, along[-1], PLACES + 1)]))
    points = np.column_stack([np.interp(places, along, column) for column in way.points.T])
    axes = np.column_stack([np.interp(places, along, column) for column in way.axes.T])
    return points, normalise(axes)
