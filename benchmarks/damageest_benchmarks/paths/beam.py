"""Checks of the beam and the beads against what is left of the part, by winding numbers at sampled points.

They share nothing with the planner, which compares outlines in a plane and the distances of bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from damageest_paths.process.frames import make_frame

from damageest.artefacts import DepositPath, Floats, Ints, Solid
from damageest.geometry.distance import distance_to_mesh, is_inside
from damageest.geometry.vectors import normalise

HEIGHTS = 12
"""Places along the beam that are looked at, and round it `AROUND`."""
AROUND = 8
THIN = 0.9
"""Share of half the bead's width at which the border of the beam is looked at, from as far above the bead on."""
ACROSS, DEEP = 5, 5
"""Places across a bead and down into it that are looked at."""
FLIP, UPRIGHT = 45.0, 5.0
"""Degrees: a turn of the rotary axis about z from one point to the next that is a flip, and the angle between tool
and z, upward or downward, below which that axis may turn freely, since it does not move the tool."""


class _Places(NamedTuple):
    """Places on the tops of the beads: ``points``, the tool's ``axes`` there (N,3), the ``move`` (N,) of the path that
    each lies on, and the length (N,) of the pass that it stands for."""

    points: Floats
    axes: Floats
    move: Ints
    length: Floats


def _sample(path: DepositPath, step: float) -> _Places:
    """Places along the passes, each standing for a stretch not longer than ``step``."""
    own = np.flatnonzero(path.on)
    runs = np.split(own, np.flatnonzero(np.diff(own) != 1) + 1) if len(own) else []
    moves, shares, weights = [], [], []
    for run in runs:
        lengths = path.moves[run]
        along = np.concatenate([[0.0], np.cumsum(lengths)])
        count = max(int(np.ceil(along[-1] / step)), 1)
        at = (np.arange(count) + 0.5) / count * along[-1]
        number = np.clip(np.searchsorted(along, at, side="right") - 1, 0, len(run) - 1)
        moves.append(run[number])
        shares.append((at - along[number]) / np.maximum(lengths[number], 1e-300))
        weights.append(np.full(count, along[-1] / count))
    if not runs:
        return _Places(np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.int64), np.empty(0))
    move, share = np.concatenate(moves), np.concatenate(shares)[:, None]
    points = path.points[move - 1] + share * (path.points[move] - path.points[move - 1])
    axes = path.axes[move - 1] * (1 - share) + share * path.axes[move]
    return _Places(points, normalise(axes), move, np.concatenate(weights))


def measure_shaded(path: DepositPath, metal: Solid, step: float) -> float:
    """The share of the points of the passes, ``step`` apart, from which metal stands in the beam.

    Looked at are the beam's axis from the bead to the nozzle's tip, and its border from half a bead's width up, as far
    as it lies above the plane of the bead's top: where a tilted beam meets metal beside the bead at that height or
    below, nothing stands between nozzle and bead. The border is not looked at where the surface of the metal is farther
    from the axis than that.
    """
    points, axes, move, _ = _sample(path, step)
    if not len(points):
        return 0.0
    radius = path.width / 2
    heights = np.linspace(0.1 * radius, path.standoff, HEIGHTS)
    middle = points[:, None] + heights[:, None] * axes[:, None]
    shaded = np.asarray(is_inside(middle.reshape(-1, 3), metal).reshape(-1, HEIGHTS).any(axis=1))
    open_ = np.flatnonzero(~shaded)
    turns = np.array([make_frame(axis, np.zeros(3)).turn[:2] for axis in axes]).reshape(-1, 2, 3)
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    round_ = THIN * radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    heights = np.linspace(radius, max(path.standoff, radius), HEIGHTS)
    middle = points[open_, None] + heights[:, None] * axes[open_, None]
    near = distance_to_mesh(middle.reshape(-1, 3), metal).reshape(-1, HEIGHTS) <= radius
    place, height = np.nonzero(near)
    border = middle[place, height][:, None] + round_ @ turns[open_[place]]
    up = np.einsum("nai,ni->na", border - points[open_[place], None], path.normals[move[open_[place]]])
    hit = is_inside(border.reshape(-1, 3), metal).reshape(-1, AROUND) & (up > 1e-6 * radius)
    shaded[open_[place[hit.any(axis=1)]]] = True
    return float(shaded.mean())


def measure_sunk(path: DepositPath, metal: Solid, step: float) -> float:
    """The volume of the beads that lies in metal, by the share of points in each bead; where beads overlap, each
    counts."""
    points, _, move, length = _sample(path, step)
    if not len(points):
        return 0.0
    normals = path.normals[move]
    beside = normalise(np.cross(path.points[move] - path.points[move - 1], normals))
    heights = path.heights[path.part[move] - 1][:, None]
    weights = length * path.section[path.part[move] - 1]
    aside = (np.arange(ACROSS) + 0.5) / ACROSS - 0.5
    down = (np.arange(DEEP) + 0.5) / DEEP
    across = points[:, None, None] + (aside[:, None] * path.width)[:, None] * beside[:, None, None]
    places = across - (down[:, None] * heights[:, None])[:, None] * normals[:, None, None]
    # where the surface is farther from the bead's middle than its corners are, all of the section is as the middle
    middle = points - heights / 2 * normals
    inside = np.repeat(is_inside(middle, metal)[:, None], ACROSS * DEEP, axis=1)
    near = np.flatnonzero(distance_to_mesh(middle, metal) < np.hypot(path.width, heights[:, 0]) / 2)
    inside[near] = is_inside(places[near].reshape(-1, 3), metal).reshape(len(near), ACROSS * DEEP)
    return float((weights * inside.mean(axis=1)).sum())


def count_flips(path: DepositPath) -> int:
    """How often the axis about z turns by more than `FLIP` from one point of a pass to the next."""
    axes = path.axes
    tilt = np.degrees(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2]))
    turn = np.degrees(np.arctan2(axes[:, 1], axes[:, 0]))
    turned = np.abs((np.diff(turn) + 180) % 360 - 180)
    tilt = np.minimum(tilt, 180 - tilt)  # a tool from below turns about the same axis
    steep = np.minimum(tilt[1:], tilt[:-1]) > UPRIGHT
    return int((steep & (turned > FLIP) & path.on[1:]).sum())
