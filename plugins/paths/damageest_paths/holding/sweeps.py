"""The nozzle's distance along a path on which its axis turns.

While the nozzle turns about the point it works on, its parts move the more the farther they are from that point. The
bound in `Clearance` takes all of it to move as its farthest point does. Here each place of an obstacle counts with its
own distance from that point, so that a few poses stand for a long stretch.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.process.process import measure_along

STRIDES = (64, 16, 4)
"""Poses for which one stands: first so many, then fewer where that does not decide."""


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
        clearance = self.clearance
        if clearance.descent is None:
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
            value = clearance.descent.bound_stretches(
                points[own], axes[own], clearance.standoff, shift, turn, needed + clearance.detail
            )
            value -= clearance.detail
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
