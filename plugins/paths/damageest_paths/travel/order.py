"""The order of the passes of a layer, so that the ways between them are short."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.process.interpass import BELOW, BESIDE, bound_waits
from damageest_paths.process.process import Pass, Process

LESS = 1e-6
"""Share of the extent of a pass by which the ways have to become shorter where passes are put in another order."""
TURN = 0.05
"""Share of the nozzle's reach that a turn of the tool by one radian counts as."""
WIDE = np.radians(45.0)
"""Angle between two tool axes from which it is asked whether the way between them is free."""
SHARES = (0.5, 0.25, 0.75)
"""Places of such a way at which it is asked."""
LIFT = 0.02
"""Height of such a way over the passes, in reaches of the nozzle."""
ROUND = 0.5
"""Reaches of the nozzle that a way which is not free counts as in addition: it leads out of a bore, and in again."""


def order_passes(passes: Sequence[Pass], last: Pass | None, clearance: Clearance, process: Process) -> list[Pass]:
    """The passes of one layer, some of them the other way round, so that the ways between them are short.

    Each is the nearest to the end of the one before, the ``last`` of the layers below for the first; then stretches of
    the sequence are run the other way round as long as that makes the ways shorter (2-opt, Croes 1958). A turn of the
    tool counts as a way too. Where it turns far, as from one mouth of a bore to the other, and the straight way between
    two passes does not keep half of the process's gap, a way round counts. Where beads have to cool down, the time that
    the tool would wait between two passes counts as the way that it makes in it.
    """
    if not passes:
        return []
    first = [] if last is None else [last.reverse()]
    both = [*first, *passes]
    cost = _measure_ways(both, clearance, process.gap)
    if process.cooling is not None:
        waits = bound_waits(both, process.cooling, float(np.hypot(BESIDE * process.bead.width, BELOW * process.height)))
        cost = np.maximum(cost, waits * process.cooling.fast / 60)
    at = 0 if first else -1
    left, ordered = list(range(2 * len(first), len(cost))), []
    while left:
        near = cost[at][left] if at >= 0 else np.zeros(1)
        begin = left[int(np.argmin(np.round(near, 9)))]
        at = begin ^ 1
        ordered.append((begin, at))
        left = [end for end in left if end not in (begin, at)]
    start = 0 if first else None
    for _ in range(len(ordered) ** 2):
        low, high, gain = _find_turn(cost, np.array(ordered), start)
        if gain <= LESS * passes[0].points.std():
            break
        ordered[low : high + 1] = [(end, begin) for begin, end in ordered[low : high + 1][::-1]]
    return [both[begin // 2] if begin % 2 == 0 else both[begin // 2].reverse() for begin, _ in ordered]


def _measure_ways(passes: Sequence[Pass], clearance: Clearance, gap: float) -> Floats:
    """What the way between each two ends of passes costs (2 N,2 N); the start of pass k is 2 k, its end 2 k + 1."""
    points = np.concatenate([one.points[[0, -1]] for one in passes])
    axes = np.concatenate([one.axes[[0, -1]] for one in passes])
    places = np.concatenate([points, TURN * clearance.reach * axes], axis=1)
    cost = cdist(places, places)
    wide = np.triu(axes @ axes.T < np.cos(WIDE))
    pairs = np.argwhere(wide & (np.arange(len(points))[:, None] // 2 != np.arange(len(points)) // 2))
    one, other = pairs[_find_blocked(points, axes, pairs, clearance, gap)].T
    cost[one, other] += ROUND * clearance.reach
    cost[other, one] = cost[one, other]
    return cost


def _find_blocked(points: Floats, axes: Floats, pairs: Ints, clearance: Clearance, gap: float) -> Flags:
    """Whether the tool is surely not free (K,) on a straight way, a little over the passes, between pairs (K,2) of
    poses."""
    moving = clearance.during_travel()
    lifted = points + (2 * gap + LIFT * clearance.reach) * axes
    blocked = np.zeros(len(pairs), bool)
    for share in SHARES:
        open_ = np.flatnonzero(~blocked)
        one, other = pairs[open_].T
        along = normalise((1 - share) * axes[one] + share * axes[other], 1e-9)
        _, most = moving.bound((1 - share) * lifted[one] + share * lifted[other], along, gap / 2)
        blocked[open_] = most < gap / 2
    return blocked


def _find_turn(cost: Floats, ordered: Ints, start: int | None) -> tuple[int, int, float]:
    """The first and last pass of the stretch that is best run the other way round, and by how much that is shorter.

    ``cost`` (M,M): of the ways between ends; ``ordered`` (N,2): the ends where each pass begins and ends; ``start``:
    the end where the way to the first one begins.
    """
    if len(ordered) < 2:
        return 0, 0, 0.0
    first, last = ordered.T
    before = np.append(-1 if start is None else start, last[:-1])
    # before a stretch, its first pass is now reached at its last point, and what follows from its first
    into, was_in = cost[before][:, last], cost[before, first]
    out = np.zeros((len(first), len(first)))
    out[:, :-1] = cost[first][:, first[1:]]
    was_out = np.append(cost[last[:-1], first[1:]], 0.0)
    if start is None:
        into[0], was_in[0] = 0.0, 0.0
    gain = np.triu(was_in[:, None] + was_out[None] - into - out)
    low, high = np.unravel_index(int(np.argmax(np.round(gain, 9))), gain.shape)
    return int(low), int(high), float(gain[low, high])
