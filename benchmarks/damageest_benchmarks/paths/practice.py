"""What a process engineer looks at first in a toolpath: starts, reversals, corners, tilts, and air under the beads.

Nothing here is shared with the planner. A bead begins at the point before the first move with the process on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from damageest.artefacts import DepositPath, Flags, Floats, Ints, Solid
from damageest.geometry.rays import RayCaster
from damageest.geometry.vectors import normalise

CORNER, REVERSAL = 60.0, 150.0
"""Turns between two moves of a bead, in degrees."""
SAME_PLACE = 0.1
"""Turns nearer to each other than this share of a bead's width are one turn."""
JOINED = 0.5
"""Distance in bead widths from the end of one bead to the start of the next, up to which the two could be one."""
TILTED, JUMP = 10.0, 20.0
"""Degrees between a tool axis and the mean one of its layer, and between two axes nearer than a bead's width."""
FLOATS, OVERHANGS = 0.2, 3.0
"""Air under a bead, in heights of it: from the first it floats, from the second on it hangs over beside the floor."""
TOUCHING, FINE = 1.0, 0.25
"""Distance in bead widths up to which two beads of a layer lie in one region, and that of the places along them."""
BESIDE = 0.6
"""Distance in bead widths up to which an earlier bead lies under a point."""
MOST = 1500
"""Points of a path at which the air is measured."""


@dataclass(frozen=True)
class Practice:
    """``starts_a_layer``: beads for each layer of a part; ``starts_a_region``: for each region of a layer whose beads
    touch each other; ``joinable``: starts near the end of the bead before, in the
    same layer; ``reversals``, ``corners``: turns with the process on; ``tilted``: share of the length whose tool axis
    leans from that of its layer; ``jumps`` of the axis; ``air``: between metal and the beads that lie on it, median and
    95 % in bead heights; ``floating``: share of the points with air under their bead."""

    starts_a_layer: float
    starts_a_region: float
    joinable: int
    reversals: int
    corners: int
    tilted: float
    jumps: int
    air: float
    air_95: float
    floating: float


def measure_practice(path: DepositPath, metal: Solid) -> Practice:
    """The figures of a path on what is left of a part, ``metal``."""
    beads = list(list_beads(path))
    if not beads:
        return Practice(0.0, 0.0, 0, 0, 0, 0.0, 0, float("nan"), float("nan"), 0.0)
    layers: dict[tuple[int, int], list[Ints]] = {}
    for bead in beads:
        layers.setdefault((int(path.part[bead[-1]]), int(path.layer[bead[-1]])), []).append(bead)
    turns = np.concatenate([_measure_turns(path.points[bead], SAME_PLACE * path.width) for bead in beads])
    tilted, jumps, length = _measure_axes(path, beads)
    air, lies = _measure_air(path, metal)
    on_metal = air[lies & (air < OVERHANGS)]
    return Practice(
        starts_a_layer=len(beads) / len(layers),
        starts_a_region=len(beads) / sum(_count_regions(path, own) for own in layers.values()),
        joinable=_count_joinable(path, beads),
        reversals=int((turns > REVERSAL).sum()),
        corners=int((turns > CORNER).sum()),
        tilted=tilted / max(length, 1e-300),
        jumps=jumps,
        air=float(np.median(on_metal)) if len(on_metal) else float("nan"),
        air_95=float(np.quantile(on_metal, 0.95)) if len(on_metal) else float("nan"),
        floating=float(((air > FLOATS) & (air < OVERHANGS)).mean()),
    )


def list_beads(path: DepositPath) -> Iterator[Ints]:
    """The points of each bead, in their order."""
    on = np.flatnonzero(path.on)
    for run in np.split(on, np.flatnonzero(np.diff(on) > 1) + 1):
        if len(run):
            yield np.concatenate([[max(run[0] - 1, 0)], run])


def _count_regions(path: DepositPath, beads: list[Ints]) -> int:
    """How many regions the beads of a layer lie in, those that touch each other in one."""
    places, number = [], []
    for k, bead in enumerate(beads):
        way = np.append(0.0, np.cumsum(path.moves[bead[1:]]))
        at = np.append(np.arange(0, way[-1], FINE * path.width), way[-1])
        places.append(np.column_stack([np.interp(at, way, path.points[bead, axis]) for axis in range(3)]))
        number.append(np.full(len(at), k))
    near = cKDTree(np.concatenate(places)).query_pairs(TOUCHING * path.width, output_type="ndarray")
    pairs = np.concatenate(number)[near]
    ones = np.ones(len(pairs), bool)
    return int(connected_components(coo_matrix((ones, pairs.T), shape=(len(beads),) * 2))[0])


def _measure_turns(points: Floats, least: float) -> Floats:
    """The angles in degrees between moves along a bead, those over less than ``least`` taken together."""
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    # a point for each stretch of that length; the first of each is kept
    kept = np.unique(np.floor(way / max(least, 1e-300)), return_index=True)[1]
    moves = np.diff(points[kept], axis=0)
    size = np.linalg.norm(moves, axis=1)
    moves = moves[size > 0] / size[size > 0, None]
    return np.asarray(np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", moves[1:], moves[:-1]), -1, 1))))


def _count_joinable(path: DepositPath, beads: list[Ints]) -> int:
    """How many beads start where the one before them in their layer ends."""
    first, last = (np.array([bead[k] for bead in beads]) for k in (0, -1))
    gap = np.linalg.norm(path.points[first[1:]] - path.points[last[:-1]], axis=1)
    same = (path.layer[last[1:]] == path.layer[last[:-1]]) & (path.part[last[1:]] == path.part[last[:-1]])
    return int((same & (gap < JOINED * path.width)).sum())


def _measure_axes(path: DepositPath, beads: list[Ints]) -> tuple[float, int, float]:
    """Length of the beads whose axis leans from the mean one of its layer, jumps of the axis, and length of all."""
    start, end = (np.concatenate([bead[some] for bead in beads]) for some in (slice(None, -1), slice(1, None)))
    step = np.linalg.norm(path.points[end] - path.points[start], axis=1)
    layer = np.unique(np.stack([path.part, path.layer]), axis=1, return_inverse=True)[1].ravel()
    mean = normalise(np.stack([np.bincount(layer, path.axes[:, k]).astype(np.float64) for k in range(3)], axis=1))
    lean, turn = (
        np.degrees(np.arccos(np.clip(np.einsum("ij,ij->i", path.axes[end], other), -1, 1)))
        for other in (mean[layer[end]], path.axes[start])
    )
    return float(step[lean > TILTED].sum()), int(((turn > JUMP) & (step < path.width)).sum()), float(step.sum())


def _measure_air(path: DepositPath, metal: Solid) -> tuple[Floats, Flags]:
    """The air (K,) under deposited points, in bead heights, and whether metal, not a bead, lies below each (K,).

    Below is against the layer's normal: along an oblique tool a bead that lies on metal seems to be above air.
    """
    on = np.flatnonzero(path.on)
    chosen = on[:: max(1, len(on) // MOST)]
    height = path.sizes[chosen, 1]
    to_metal = RayCaster(metal).find_first(path.points[chosen], -path.normals[chosen])[0]
    to_bead = np.array([_find_bead_below(path, on, k) for k in chosen])
    air = np.maximum(np.minimum(to_metal, to_bead) - height, 0) / height
    return air, to_metal < to_bead


def _find_bead_below(path: DepositPath, on: Ints, k: int) -> float:
    """The distance from point ``k`` against the layer's normal to the bead of an earlier layer; inf without one."""
    earlier = on[on < k]
    earlier = earlier[(path.layer[earlier] < path.layer[k]) | (path.part[earlier] < path.part[k])]
    way = path.points[k] - path.points[earlier]
    up = way @ path.normals[k]
    beside = np.linalg.norm(way - up[:, None] * path.normals[k], axis=1)
    below = up[(beside < BESIDE * path.width) & (up > 0)]
    return float(below.min()) if len(below) else float("inf")
