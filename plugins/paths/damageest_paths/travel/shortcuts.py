"""Cuts the corners of a way of the tool between passes."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.travel.network import Way, measure_way

PLACES = 32
"""Places along a way, besides its own, between which the tool may go straight."""


def cut_corners(way: Way, clearance: Clearance, gap: float) -> Way:
    """A way that goes straight between places of a clear one, where that is clear; it has the same ends."""
    for _ in range(2):
        way = _turn_round(_cut_forward(way, clearance, gap))
    return way


def _turn_round(way: Way) -> Way:
    return Way(way.points[::-1], way.axes[::-1], way.gap)


def _cut_forward(way: Way, clearance: Clearance, gap: float) -> Way:
    """From each place the tool goes to one of the farthest that it sees, which is found by halving: what lies between
    is not looked at. The way as it is, where the next place is not seen: there the axis turns in another way."""
    points, axes = _divide(way, clearance)

    def measure(one: int, other: int) -> float:
        return measure_way(points[[one, other]], axes[[one, other]], clearance, gap)

    kept, least = [0], np.inf
    while kept[-1] < len(points) - 1:
        here = kept[-1]
        # the end is tried first
        near, middle, far, found = here, len(points) - 1, len(points), 0.0
        while middle > near:
            own = measure(here, middle)
            near, far, found = (middle, far, own) if own >= gap / 2 else (near, middle, found)
            middle = (near + far) // 2
        if near == here:
            return way
        kept.append(near)
        least = min(least, found)
    return Way(points[kept], axes[kept], least)


def _divide(way: Way, clearance: Clearance) -> tuple[Floats, Floats]:
    """The points (N,3) and axes (N,3) of a way with more places in between, as far apart as each other; a turn on the
    spot counts by how far the nozzle moves."""
    moves = clearance.bound_moves(way.points, way.axes)
    along = np.concatenate([[0.0], np.cumsum(moves)])
    places = np.unique(np.concatenate([along, np.linspace(0, along[-1], PLACES + 1)]))
    points = np.column_stack([np.interp(places, along, column) for column in way.points.T])
    axes = np.column_stack([np.interp(places, along, column) for column in way.axes.T])
    return points, normalise(axes)
