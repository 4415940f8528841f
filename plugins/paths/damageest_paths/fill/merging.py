"""Merges rings that lie beside each other into one ring, by a pair of links across the strip between them.

Both rings are cut, and their ends linked crosswise, so that the tool turns round from one to the other as from row to
row. By and by all rings of a region become one, whatever holes and arms it has (compare Zhao et al. 2016).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest_paths.fill.regions import close_ring, resample

FINE = 0.25
"""Steps between the places at which rings may be cut."""
FAR, NEAR = 1.4, 0.55
"""Steps between two rings where they are linked: at most, and at least, so that both links are beads of their own."""
STRAIGHT = 0.9
"""Share of the stretch between its two links that a ring's straight way is at least."""
MARGIN = 0.5
"""Steps before its start and behind its end over which the stretch is straight."""
SHORT = 4.0
"""Steps that a ring is long at least."""


class _Cut(NamedTuple):
    """``cost``, and the two rings as lines (K,2): one goes on where the other ends, and back."""

    cost: float
    first: Floats
    second: Floats


def merge_rings(rings: list[Floats], step: float) -> list[Floats]:
    """The rings (K,2), those merged that lie a ``step`` or a little more from each other."""
    fine = [resample(close_ring(ring), FINE * step)[0][:-1] for ring in rings]
    left = dict(enumerate(fine))
    cuts = {(i, j): _find_cut(left[i], left[j], step) for i in left for j in left if i < j}
    while True:
        best = min(((cut.cost, pair) for pair, cut in cuts.items() if cut is not None), default=None)
        if best is None:
            return list(left.values())
        one, other = best[1]
        cut = cuts[one, other]
        assert cut is not None
        left[one] = np.concatenate([cut.first, cut.second])
        del left[other]
        cuts = {pair: each for pair, each in cuts.items() if not {one, other} & set(pair)}
        cuts |= {
            (min(one, k), max(one, k)): _find_cut(left[min(one, k)], left[max(one, k)], step) for k in left if k != one
        }


def _find_cut(one: Floats, other: Floats, step: float) -> _Cut | None:
    """Where two rings are best linked: where the two links are shortest; None where they are too far apart."""
    after, ok = _find_after(one, step)
    low, high = other.min(axis=0) - FAR * step, other.max(axis=0) + FAR * step
    ok &= ((one >= low) & (one <= high)).all(axis=1)
    places = np.flatnonzero(ok)
    if not len(places):
        return None
    far = np.linalg.norm(one[places, None] - other[None], axis=2)
    nearest = far.argmin(axis=1)
    best: _Cut | None = None
    for turned in (False, True):
        ring = other[::-1] if turned else other
        start = len(other) - 1 - nearest if turned else nearest
        ahead, fits = _find_after(ring, step)
        links = np.stack(
            [far[np.arange(len(places)), nearest], np.linalg.norm(one[after[places]] - ring[ahead[start]], axis=1)]
        )
        cost = np.where(
            fits[start] & (links.max(axis=0) <= FAR * step) & (links.min(axis=0) >= NEAR * step),
            links.sum(axis=0),
            np.inf,
        )
        k = int(np.argmin(np.round(cost, 6)))
        if np.isfinite(cost[k]) and (best is None or cost[k] < best.cost):
            # the other ring runs from beside the end of the first one backward to beside its start
            first = _take(one, int(after[places[k]]), int(places[k]))
            second = _take(ring[::-1], len(ring) - 1 - int(start[k]), len(ring) - 1 - int(ahead[start[k]]))
            best = _Cut(float(cost[k]), first, second)
    return best


def _find_after(ring: Floats, step: float) -> tuple[Ints, Flags]:
    """For each corner of a ring the number of the first one at least a step along it, and whether (K,) the way there is
    straight."""
    length = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    total = float(length.sum())
    if total < SHORT * step:
        return np.zeros(len(ring), np.int64), np.zeros(len(ring), bool)
    at = np.concatenate([[0.0], np.cumsum(np.tile(length, 2))])
    here = at[: len(ring)]
    after = np.searchsorted(at, here + step * (1 - 1e-9)) % len(ring)
    # straight from before the first link to behind the second one: no link is at a corner
    low, high = (np.searchsorted(at, (here + way) % total) % len(ring) for way in (-MARGIN * step, (1 + MARGIN) * step))
    straight = np.linalg.norm(ring[high] - ring[low], axis=1) >= STRAIGHT * (1 + 2 * MARGIN) * step
    return after, straight


def _take(ring: Floats, first: int, last: int) -> Floats:
    """The corners of a ring from one number on to another."""
    return np.roll(ring, -first, axis=0)[: (last - first) % len(ring) + 1]
