"""Lets the tool axis turn along a pass: axes chosen by dynamic programming, and turned evenly from one to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise
from damageest_paths.process.process import measure_along

BLOCKED, CUT, TURN, TIGHT, TILT = 100.0, 30.0, 6.0, 0.2, 0.2
"""Costs: of a pose that is not free; of a cut in the pass; of a turn by one radian; of a pose without room to spare; of
a tilt of one radian at one pose."""
FARTHEST = np.radians(50.0)
"""Angle between two axes up to which the tool turns from one to the other in one go."""


ROTARY, UPRIGHT = np.radians(30.0), np.radians(5.0)
"""Turn of the rotary axis about z from which the poses of a pass are divided, and the angle between tool and z, upward
or downward, below which that axis may turn freely, since it hardly moves the tool."""
DIVISIONS = 5
"""How often two poses are divided at most."""


class Course(NamedTuple):
    """``axes`` (N,3) at the points of a pass; ``joined`` (N-1,): whether the pass goes on from each point to the
    next."""

    axes: Floats
    joined: Flags


def cost_poses(low: Floats, high: Floats, axes: Floats, needed: float, room: float) -> Floats:
    """What each pose costs, (N,M) for points and axes, from bounds (N,M) of its distance."""
    tilt = np.arccos(np.clip(axes[:, 2], -1, 1))
    return np.where(high < needed, BLOCKED, TILT * tilt + TIGHT * (low < needed) + TIGHT * (high < room))


def plan_course(points: Floats, axes: Floats, costs: Floats, rate: float) -> Course:
    """The axes along a pass of ``points`` (N,3) that cost least, of ``axes`` (M,3) with ``costs`` (N,M).

    ``rate``: largest turn per length, in radians. Over the length that a turn takes, both axes have to be free.
    """
    along = measure_along(points)
    angle = np.arccos(np.clip(axes @ axes.T, -1, 1))
    before, ends = _find_best(along, angle, costs, rate)
    joined = np.ones(max(len(points) - 1, 0), bool)
    found = axes[np.zeros(len(points), np.int64)]
    at, own = len(points) - 1, int(ends.argmin())
    while at >= 0:
        found[at] = axes[own]
        start, old = before[at][0][own], before[at][1][own]
        if start < 0:
            break
        if before[at][2][own]:
            joined[start] = False
        elif old != own:
            share = (along[start : at + 1] - along[start]) / max(along[at] - along[start], 1e-300)
            found[start : at + 1] = turn_evenly(axes[old], axes[own], share)
        at, own = int(start), int(old)
    return Course(found, joined)


def _find_best(
    along: Floats, angle: Floats, costs: Floats, rate: float
) -> tuple[list[tuple[Ints, Ints, Flags]], Floats]:
    """For each point and axis: the point and the axis from which the cheapest way comes, and whether it is cut there;
    and the costs (M,) of the ways that end with each axis."""
    count = len(angle)
    total = np.concatenate([np.zeros((1, count)), np.cumsum(costs, axis=0)])
    length = np.where((angle > 1e-9) & (angle <= FARTHEST), angle / max(rate, 1e-300), np.inf)
    own, column = np.arange(count), np.arange(count)[:, None]
    best = np.full((len(along), count), np.inf)
    best[0] = costs[0]
    came: list[tuple[Ints, Ints, Flags]] = [(np.full(count, -1), own, np.zeros(count, bool))]
    for k in range(1, len(along)):
        stay = best[k - 1] + costs[k]
        cheapest = int(best[k - 1].argmin())
        cut = best[k - 1, cheapest] + CUT + costs[k]
        is_cut = cut < stay
        value, start, old = np.where(is_cut, cut, stay), np.full(count, k - 1), np.where(is_cut, cheapest, own)
        since = np.searchsorted(along, along[k] - length + 1e-12 * along[-1], side="right") - 1
        possible = since >= 0
        since = np.maximum(since, 0)
        # rows: from which axis; columns: to which
        spent = total[k + 1] - total[since + 1, own[None, :]]
        spent = spent + total[k + 1][:, None] - total[since + 1, column]
        turned = np.where(possible, best[since, column] + spent + TURN * angle, np.inf)
        source = turned.argmin(axis=0)
        better = turned[source, own] < value
        value = np.where(better, turned[source, own], value)
        start, old = np.where(better, since[source, own], start), np.where(better, source, old)
        best[k] = value
        came.append((start, old, is_cut & ~better))
    return came, best[-1]


def turn_evenly(first: Floats, last: Floats, share: Floats) -> Floats:
    """Axes (N,3) on the shortest turn from ``first`` (3,) to ``last`` (3,), at each ``share`` (N,) of its angle."""
    angle = float(np.arccos(np.clip(first @ last, -1, 1)))
    if angle < 1e-9:
        return np.tile(last, (len(share), 1))
    found = np.sin((1 - share) * angle)[:, None] * first + np.sin(share * angle)[:, None] * last
    return normalise(found)


def divide_turns(points: Floats, axes: Floats, normals: Floats) -> tuple[Floats, Floats, Floats]:
    """Poses of a pass, (N,3) each, with more of them where the axis about z turns far from one to the next.

    Where the tool passes z at a few degrees, that axis turns by up to half a turn while the tool hardly moves. A
    control turns it evenly between two poses: with poses close by the tool stays on its way, and the speed of that axis
    can be told.
    """
    for _ in range(DIVISIONS):
        lying = np.hypot(axes[:, 0], axes[:, 1])
        turn = np.arctan2(axes[:, 1], axes[:, 0])
        turned = np.abs((np.diff(turn) + np.pi) % (2 * np.pi) - np.pi)
        far = np.flatnonzero((turned > ROTARY) & (np.minimum(lying[1:], lying[:-1]) > np.sin(UPRIGHT)))
        if not len(far):
            break
        points = np.insert(points, far + 1, (points[far] + points[far + 1]) / 2, axis=0)
        axes, normals = (
            np.insert(rows, far + 1, normalise(rows[far] + rows[far + 1]), axis=0) for rows in (axes, normals)
        )
    return points, axes, normals
