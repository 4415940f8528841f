"""The time between beads that lie next to each other, and waits that make it long enough to cool down."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from damageest.artefacts import DepositPath, Floats, Ints
from damageest_paths.places import find_middles

BESIDE, BELOW, ABOVE = 1.1, 1.5, 0.5
"""How far beside, in bead widths, and below and above, in heights of a layer, beads are neighbours."""


def measure_rest(path: DepositPath) -> Floats:
    """Seconds (N,) from laying the last bead of another pass that lies beside or below each move that deposits, to that
    move; inf where there is none, and on travel. Of a path whose moves are not longer than its beads are wide."""
    earlier, later = _pair_neighbours(path)
    times = _find_times(path)
    found = np.full(len(times), np.inf)
    np.minimum.at(found, later, times[later] - times[earlier])
    return found


def add_waits(path: DepositPath, least: float) -> DepositPath:
    """The path with waits at the starts of passes, so that between laying neighbouring beads of two passes there are
    ``least`` seconds. Waits are as short as that permits; the order of the passes stays."""
    earlier, later = _pair_neighbours(path)
    if not least or not len(later):
        return path
    times = _find_times(path)
    pairs = np.stack([path.number[later], path.number[earlier]], axis=1)
    (passes, number) = np.unique(pairs, axis=0, return_inverse=True)
    gap = np.full(len(passes), np.inf)
    np.minimum.at(gap, number.ravel(), times[later] - times[earlier])
    shift = np.zeros(path.passes + 1)  # of all times of a pass, by the waits before it
    for own in range(1, path.passes + 1):
        rows = passes[:, 0] == own
        needed = least - gap[rows] + shift[passes[rows, 1]]
        shift[own] = max(shift[own - 1], needed.max(initial=0.0))
    dwell = np.zeros(len(times))
    starts = np.flatnonzero(~path.on[:-1] & path.on[1:])
    dwell[starts] = np.diff(shift)[path.number[starts + 1] - 1]
    return replace(path, dwell=dwell) if dwell.any() else path


def _find_times(path: DepositPath) -> Floats:
    """The time (N,) of the middle of each move, in seconds."""
    spent = 60 * path.moves / path.feed
    waited = np.zeros(len(spent)) if path.dwell is None else path.dwell
    return np.asarray(np.cumsum(spent + waited) - waited - spent / 2)


def _pair_neighbours(path: DepositPath) -> tuple[Ints, Ints]:
    """The moves (K,) that deposit, and later moves (K,) of other passes that deposit beside or on them."""
    own = np.flatnonzero(path.on)
    if len(own) < 2:
        return own[:0], own[:0]
    places = find_middles(path)[own]
    heights = path.heights[path.part[own] - 1]
    reach = float(np.hypot(BESIDE * path.width, BELOW * heights.max()))
    first, second = KDTree(places).query_pairs(reach, output_type="ndarray").T
    first, second = np.minimum(first, second), np.maximum(first, second)
    away = places[second] - places[first]
    rise = np.einsum("ij,ij->i", away, path.normals[own][second])
    beside = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - rise**2, 0.0))
    near = (beside <= BESIDE * path.width) & (rise <= BELOW * heights[second]) & (rise >= -ABOVE * heights[second])
    near &= path.number[own][first] != path.number[own][second]
    return own[first[near]], own[second[near]]
