"""Stacks: points that a scanner measured again at the same place, which are no more than one place of the skin."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import make_tree, query_at_few
from damageest.geometry.patches import Patches

MOST = 64
"""Points of a stack up to which it is recognised."""
JUMP = 4.0
"""From the farthest point of a stack to the nearest one beside it: distances grow so much. Of points that are strewn at
random, 1 in 15 has such a jump."""
SHARE = 0.25
"""Share of the points in stacks from which a scan has stacks."""
STEADY = 0.25
"""Variation of the distances of pairs, over their mean, below which they may be the two skins of a thin wall."""
CLOSE = 1 / 30
"""Distance of the points of a pair, over that to the next ones, below which they are no two skins of a wall."""
WIDE = 1.5
"""Reach within which points are of one stack, over the width of most stacks."""
_SAMPLES = 600
_FEWEST = 500


def find_stacks(points: Floats) -> tuple[Ints, float] | None:
    """The number (N,) of the stack of each of the points (N,3), and the reach within which they are of one; None where
    the points lie in no stacks.

    A stack is a group of points that is much narrower than the gap around it, for example from repeated exposures,
    copies in a file, or rounding. Points are in stacks where the distances to their neighbours, nearest first, jump
    after a few.
    """
    if len(points) < _FEWEST:
        return None
    rng = np.random.default_rng(0)
    places = points[rng.choice(len(points), min(_SAMPLES, len(points)), replace=False)]
    count = min(MOST + 2, len(points))
    far = query_at_few(points, places, count, rng)[0][:, 1:]
    jump = far[:, 1:] / np.maximum(far[:, :-1], 1e-300)
    last = jump.argmax(axis=1)
    row = np.flatnonzero(jump.max(axis=1) > JUMP)
    if len(row) < SHARE * len(places):
        return None
    inner, outer = far[row, last[row]], far[row, last[row] + 1]
    width, gap = float(np.median(inner)), float(np.median(outer))
    if np.median(last[row]) == 0 and inner.std() < STEADY * inner.mean() and width > CLOSE * gap:
        return None
    reach = min(WIDE * float(np.quantile(inner, 0.95)), float(np.sqrt(width * gap)))
    return _group_within(points, reach), reach


def _group_within(points: Floats, reach: float) -> Ints:
    """(N,) the number of the group of each point, in the order of their first points; points of one group are linked by
    gaps up to about ``reach``."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    low = points.min(axis=0)
    cubes = Patches.in_cubes(points - low, reach / 2)
    means = cubes.mean(points - low)
    pairs = make_tree(means).query_pairs(reach, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), bool), pairs.T), shape=(len(means), len(means)))
    label = connected_components(links, directed=False)[1][cubes.group]
    order = np.unique(label, return_index=True)[1].argsort().argsort()
    return np.asarray(order[label], np.int64)
