"""Checks of the beam and the beads against what is left of the part, by winding numbers at sampled points.

They share nothing with the planner, which compares outlines in a plane and the distances of bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from damageest_paths.frames import make_frame

from damageest.artefacts import DepositPath, Floats, Ints, Solid
from damageest.geometry.distance import is_inside
from damageest.geometry.vectors import normalise

HEIGHTS = 12
"""Places along the beam that are looked at, and round it `AROUND`."""
AROUND = 8
THIN = 0.9
"""Share of half the bead's width at which the border of the beam is looked at, from as far above the bead on."""
ACROSS, DEEP = 5, 5
"""Places across a bead and down into it that are looked at."""
FLIP, UPRIGHT = 45.0, 5.0
"""Degrees: a turn of the rotary axis about z from one point to the next that is a flip, and the tilt below which that
axis may turn freely, since it does not move the tool."""


class _Places(NamedTuple):
    """Places on the tops of the beads: ``points``, the tool's ``axes`` there (N,3), the ``move`` (N,) of the path that
    each lies on, and how much of it (N,) it stands for."""

    points: Floats
    axes: Floats
    move: Ints
    share: Floats


def _sample(path: DepositPath, step: float) -> _Places:
    """Places not farther apart than ``step``."""
    own = np.flatnonzero(path.on)
    counts = np.maximum(np.ceil(path.moves[own] / step).astype(int), 1)
    move = np.repeat(own, counts)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts] or [np.empty(0)])[:, None]
    points = path.points[move - 1] + share * (path.points[move] - path.points[move - 1])
    axes = path.axes[move - 1] * (1 - share) + share * path.axes[move]
    return _Places(points, normalise(axes), move, 1 / np.repeat(counts, counts))


def measure_shaded(path: DepositPath, metal: Solid, step: float) -> float:
    """The share of the points of the passes, ``step`` apart, from which metal stands in the beam.

    Looked at are the beam's axis from the bead to the nozzle's tip, and its border from half a bead's width up.
    """
    points, axes, _, _ = _sample(path, step)
    if not len(points):
        return 0.0
    radius = path.width / 2
    shaded = np.zeros(len(points), bool)
    for height in np.linspace(0.1 * radius, path.standoff, HEIGHTS):
        shaded |= is_inside(points + height * axes, metal)
    turns = np.array([make_frame(axis, np.zeros(3)).turn[:2] for axis in axes])
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    for height in np.linspace(radius, max(path.standoff, radius), HEIGHTS):
        for angle in angles:
            beside = THIN * radius * (np.cos(angle) * turns[:, 0] + np.sin(angle) * turns[:, 1])
            shaded |= is_inside(points + height * axes + beside, metal)
    return float(shaded.mean())


def measure_sunk(path: DepositPath, metal: Solid, step: float) -> float:
    """The volume of the beads that lies in metal, by the share of points in each bead; where beads overlap, each
    counts."""
    points, _, move, share = _sample(path, step)
    if not len(points):
        return 0.0
    normals = path.normals[move]
    beside = normalise(np.cross(path.points[move] - path.points[move - 1], normals))
    heights = path.heights[path.part[move] - 1][:, None]
    weights = path.moves[move] * path.section[path.part[move] - 1] * share
    total = 0.0
    for aside in (np.arange(ACROSS) + 0.5) / ACROSS - 0.5:
        for down in (np.arange(DEEP) + 0.5) / DEEP:
            total += float(
                weights[is_inside(points + aside * path.width * beside - down * heights * normals, metal)].sum()
            )
    return total / (ACROSS * DEEP)


def count_flips(path: DepositPath) -> int:
    """How often the axis about z turns by more than `FLIP` from one point of a pass to the next."""
    axes = path.axes
    tilt = np.degrees(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2]))
    turn = np.degrees(np.arctan2(axes[:, 1], axes[:, 0]))
    turned = np.abs((np.diff(turn) + 180) % 360 - 180)
    steep = np.minimum(tilt[1:], tilt[:-1]) > UPRIGHT
    return int((steep & (turned > FLIP) & path.on[1:]).sum())
