"""The tool axes that a machine reaches: those whose angle with one vector lies between two limits."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.vectors import normalise
from damageest_paths.process.frames import Frame

INSIDE, EXACT = 1e-7, 1e-9
"""Cosine by which an axis is moved within the limits, and by which it may be beyond them."""


def turn_reach(reach: Floats | None, frame: Frame) -> Floats | None:
    """The reach (5,), see the stage `path`, in a frame's local coordinates."""
    return None if reach is None else np.append(frame.turn @ reach[:3], reach[3:])


def is_reached(axes: Floats, reach: Floats | None) -> Flags:
    """Whether the machine reaches each of the axes (N,3)."""
    if reach is None:
        return np.ones(len(axes), bool)
    cosine = axes @ reach[:3]
    return np.asarray((cosine >= reach[3] - EXACT) & (cosine <= reach[4] + EXACT))


def keep_reached(axes: Floats, reach: Floats | None) -> Floats:
    """The axes (N,3), each of those that the machine does not reach moved to the nearest that it does."""
    far = ~is_reached(axes, reach)
    if reach is None or not far.any():
        return axes
    cosine = axes @ reach[:3]
    side = normalise(axes - cosine[:, None] * reach[:3], 1e-12)
    within = np.clip(cosine, reach[3] + INSIDE, reach[4] - INSIDE)
    moved = within[:, None] * reach[:3] + np.sqrt(1 - within**2)[:, None] * side
    return np.where(far[:, None], moved, axes)
