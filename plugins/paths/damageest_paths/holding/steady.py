"""Tool axes along a pass that do not shake: a layer on a scanned floor is rough, and its normals with it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest_paths.process.process import measure_along

LEAST, MOST = 2.0, 32.0
"""Lengths in bead widths over which axes are averaged: at least, and at most where they turn too fast."""
SPARE = 0.9
"""Share of the largest rate up to which an averaged axis may turn."""


def steady_axes(points: Floats, axes: Floats, rate: float, width: float) -> Floats:
    """The axes (N,3), each the mean over some of the pass round its point (N,3): over as much as it takes for them to
    turn by no more than ``rate``, in radians per length. ``width`` of a bead."""
    along = measure_along(points)
    found, span = axes, LEAST * width
    while span <= MOST * width:
        found = _average(along, axes, span)
        turns = np.linalg.norm(np.diff(found, axis=0), axis=1)
        if (turns <= SPARE * rate * np.diff(along)).all():
            break
        span *= 2
    return found


def _average(along: Floats, axes: Floats, span: float) -> Floats:
    """The mean axis over a span round each point, as far as the pass goes."""
    means = (axes[1:] + axes[:-1]) / 2
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(means * np.diff(along)[:, None], axis=0)])
    low, high = (
        np.stack([np.interp(at, along, total[:, k]) for k in range(3)], axis=1)
        for at in (along - span / 2, along + span / 2)
    )
    return normalise(high - low)
