"""The nozzle's distance along a path on which its axis turns.

While the nozzle turns about the point it works on, its parts move the more the farther they are from that point. The
bound in `Clearance` takes all of it to move as its farthest point does. Here each place of an obstacle counts with its
own distance from that point, so that a few poses stand for a long stretch.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.clearance import Clearance
from damageest_paths.descent import list_members, measure_points
from damageest_paths.process import measure_along

STRIDES = (64, 16, 4)
"""Poses for which one stands: first so many, then fewer where that does not decide."""
CHUNK = 100
"""Poses that go down the tree of balls at once."""


class Sweeps:
    """A nozzle among the obstacles of a `Clearance`, along paths on which it turns. It is a `Gauge`."""

    def __init__(self, clearance: Clearance) -> None:
        self.clearance = clearance

    def bound_turns(self, axes: Floats) -> Floats:
        """As `Clearance.bound_turns`."""
        return self.clearance.bound_turns(axes)

    def measure_poses(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """For each pose (N,) a distance that the nozzle keeps at least; below ``needed`` only where it really is.

        ``points``, ``axes`` (N,3): poses that follow each other along a path, as those of `Clearance.measure_poses`.
        """
        clearance, near = self.clearance, self.clearance.obstacles
        if near is None or not near.levels:
            return np.full(len(points), np.inf)
        if clearance.nozzle.profile is None:
            return clearance.measure_poses(points, axes, needed)
        body = clearance.without_beam()
        gone = measure_along(points)
        turned = np.concatenate([[0.0], np.cumsum(_measure_turns(axes))])
        found = np.full(len(points), -np.inf)
        for stride in STRIDES:
            starts = np.arange(0, len(points), stride)
            low = starts[np.minimum.reduceat(found, starts) == -np.inf]
            if not len(low):
                break
            high = np.minimum(low + stride, len(points)) - 1
            own = (low + high) // 2
            shift = np.maximum(gone[high] - gone[own], gone[own] - gone[low])
            turn = np.maximum(turned[high] - turned[own], turned[own] - turned[low])
            value = bound_sweeps(clearance, points[own], axes[own], shift, turn, needed)
            for first, last, least in zip(low, high, value, strict=True):
                if least >= needed:
                    found[first : last + 1] = np.maximum(found[first : last + 1], least)
        rest = np.flatnonzero(found == -np.inf)
        if len(rest):
            found[rest] = body.measure_poses(points[rest], axes[rest], needed)
        open_ = np.flatnonzero(found >= needed)
        if clearance.beam is not None and len(open_):
            found[open_[clearance.find_shaded(points[open_], axes[open_])]] = 0.0
        return found


def _measure_turns(axes: Floats) -> Floats:
    """The angles (N-1,) in radians between each two axes (N,3)."""
    chord = np.linalg.norm(np.diff(axes, axis=0), axis=1)
    return np.asarray(2 * np.arcsin(np.clip(chord / 2, 0, 1)))


def bound_sweeps(
    clearance: Clearance, points: Floats, axes: Floats, shift: Floats, turn: Floats, needed: float
) -> Floats:
    """A distance (N,) that the nozzle keeps at least while the point it works on stays within ``shift`` (N,) of each of
    ``points`` (N,3), and its axis within the angle ``turn`` (N,) of ``axes`` (N,3).

    Distances are not computed well where they are larger than ``needed``; 0 or less where it is not kept.
    """
    near, profile = clearance.obstacles, clearance.nozzle.profile
    assert near is not None
    assert profile is not None
    wanted = needed + clearance.detail
    points, axes = np.ascontiguousarray(points.T), np.ascontiguousarray(axes.T)
    ends = points + clearance.standoff * axes
    found = np.full(len(shift), 2 * wanted)
    roots = np.flatnonzero(near.levels[0].top > clearance.floor)
    for start in range(0, len(shift), CHUNK):
        own = np.arange(start, min(start + CHUNK, len(shift)))
        pose, ball = np.repeat(own, len(roots)), np.tile(roots, len(own))
        for number, level in enumerate(near.levels):
            if not len(ball):
                break
            middle, radius = level.middle.take(ball, 1), level.radius[ball]
            away = measure_points(middle, ends.take(pose, 1), axes.take(pose, 1), profile, clearance.endless)
            # the place of the nozzle that comes near is as far from the point it works on as the obstacle, and the
            # distance between them
            far = np.linalg.norm(middle - points.take(pose, 1), axis=0) + np.maximum(away, 0.0) + radius
            value = away - radius - turn[pose] * far - shift[pose]
            if number == len(near.levels) - 1:
                np.minimum.at(found, pose, value)
                break
            kept = value < wanted
            np.minimum.at(found, pose[~kept], value[~kept])
            # a pose at which a place on an obstacle is too near needs no other
            which, one = pose[kept], level.one.take(ball[kept], 1)
            surface = measure_points(one, ends.take(which, 1), axes.take(which, 1), profile, clearance.endless)
            far = np.linalg.norm(one - points.take(which, 1), axis=0) + np.maximum(surface, 0.0)
            hit = np.zeros(len(shift), bool)
            hit[which[surface - turn[which] * far - shift[which] < wanted]] = True
            found[hit] = -np.inf
            pose, ball = pose[kept][~hit[pose[kept]]], ball[kept][~hit[pose[kept]]]
            ball = list_members(ball)
            pose, ball = np.repeat(pose, ball.shape[1]), ball.ravel()
            high = near.levels[number + 1].top[ball] > clearance.floor
            pose, ball = pose[high], ball[high]
    return np.asarray(found - clearance.detail)
