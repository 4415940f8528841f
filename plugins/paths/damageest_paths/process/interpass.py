"""The time between beads that lie next to each other, and waits that make it long enough to cool down."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from damageest.artefacts import DepositPath, Floats, Ints
from damageest_paths.fill.regions import resample
from damageest_paths.process.places import find_middles
from damageest_paths.process.process import Cooling, Pass, measure_along

BESIDE, BELOW, ABOVE = 1.1, 1.5, 0.5
"""How far beside, in bead widths, and below and above, in heights of a layer, beads are neighbours."""

SPACING = 0.25
"""Bead widths between the places of a pass at which times are compared, where its moves are shorter."""


def measure_rest(path: DepositPath) -> Floats:
    """Seconds (N,) from laying the last bead of another pass that lies beside or below each move that deposits, to that
    move; inf where there is none, and on travel. Of a path whose moves are not longer than its beads are wide; where
    they are much shorter, several have the time of the first of them."""
    chosen = _choose_moves(path)
    earlier, later = _pair_neighbours(path, chosen)
    times = _find_times(path)
    found = np.full(len(times), np.inf)
    np.minimum.at(found, later, times[later] - times[earlier])
    own = np.flatnonzero(path.on)
    found[own] = found[chosen[np.searchsorted(chosen, own, side="right") - 1]]
    return found


def bound_waits(passes: Sequence[Pass], cooling: Cooling, reach: float) -> Floats:
    """Seconds (2 N,2 N) from the end of one pass to the beginning of another that is laid next, so that beads of both
    nearer than ``reach`` have the time to cool down; 0 where none are. The start of pass k is 2 k, its end 2 k + 1, and
    which of them is named says how the pass is run."""
    lines = [resample(one.points, reach / 2)[0] for one in passes]
    numbers = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    along = [measure_along(line) for line in lines]
    ends = np.concatenate([np.stack([one, one[-1] - one], axis=1) for one in along])  # the way to start and end
    tree = KDTree(np.concatenate(lines))
    first, second = tree.query_pairs(reach, output_type="ndarray").T
    near = numbers[first] != numbers[second]
    first, second = np.concatenate([[first[near], second[near]], [second[near], first[near]]], axis=1)
    least = np.full((2 * len(lines), 2 * len(lines)), np.inf)
    for begin in (0, 1):
        for end in (0, 1):
            way = ends[first, begin] + ends[second, end]
            np.minimum.at(least, (2 * numbers[first] + begin, 2 * numbers[second] + end), way)
    return np.maximum(cooling.seconds - 60 * least / cooling.feed, 0.0)


def add_waits(path: DepositPath, least: float) -> DepositPath:
    """The path with waits at the starts of passes, so that between laying neighbouring beads of two passes there are
    ``least`` seconds. Waits are as short as that permits in the order that the passes have."""
    earlier, later = _pair_neighbours(path, _choose_moves(path))
    if not least or not len(later):
        return path
    times = _find_times(path)
    pairs = np.stack([path.number[later], path.number[earlier]], axis=1)
    passes, number = np.unique(pairs, axis=0, return_inverse=True)
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
    return np.asarray(np.cumsum(spent + path.waits) - path.waits - spent / 2)


def _choose_moves(path: DepositPath) -> Ints:
    """Moves (K,) that deposit: the first of each pass, and those at which it is a share of the bead's width longer."""
    own = np.flatnonzero(path.on)
    place = np.floor(np.cumsum(path.moves[own]) / (SPACING * path.width))
    is_new = np.diff(place, prepend=-1) + np.diff(path.number[own], prepend=0) > 0
    return np.asarray(own[is_new])


def _pair_neighbours(path: DepositPath, own: Ints) -> tuple[Ints, Ints]:
    """Of ``own`` moves (N,): some (K,), and later ones (K,) of other passes that deposit beside or on them."""
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
