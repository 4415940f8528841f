"""Poses that a near symmetry of the part makes of the best one: the random search may find only one of them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.transforms import make_motions
from damageest.stages.align.search.search import refine, score, select_distinct
from damageest.stages.align.surface.oriented_points import OrientedPoints, draw_by_direction, orient_surface
from damageest.stages.align.surface.plane_grid import PartSurface, PlaneGrid

STEP = 5.0
"""Step of the angles, in degrees."""
WIDE, FINE = 0.03, 0.006
"""Bands of the refinement, in diagonals: a near symmetry does not go through the part's middle exactly."""
POINTS = 400
TRIED = 24
"""Number of turned poses that are refined."""
LESS = 0.3
"""By how much less than the best pose a turned one may explain before it is refined."""
APART = 0.03
"""Distance of two poses, in diagonals, below which they are the same one."""


def turn_poses(poses: Floats, target: PartSurface, field: PlaneGrid, scan: OrientedPoints) -> Floats:
    """Poses (K,4,4) that turn the first of ``poses`` (H,4,4) about the part's principal axes, with and without a half
    turn about another one, and that explain the scan roughly; none that is near one of ``poses``.

    The axis of a symmetry is a principal axis of the part, and that of a near symmetry is near one.
    """
    few = draw_by_direction(scan, POINTS, np.random.default_rng(0))
    turned = _make_turns(target) @ poses[0]
    scores = score(turned, few, field, WIDE)
    turned = turned[scores > float(score(poses[:1], few, field, WIDE)[0]) - LESS]
    if not len(turned):
        return np.zeros((0, 4, 4))
    turned = turned[select_distinct(turned, score(turned, few, field, WIDE), APART, TRIED)]
    turned = refine(turned, few, field, np.geomspace(WIDE, FINE, 6))
    together = np.concatenate([poses, turned])
    # the poses that are there already come first, so that a turned one near them is left out
    order = -np.arange(len(together), dtype=np.float64)
    kept = select_distinct(together, order, APART, len(together))
    return np.asarray(together[kept[kept >= len(poses)]])


def _make_turns(target: PartSurface) -> Floats:
    """Motions (M,4,4) of the part about its principal axes."""
    points = orient_surface(target.known, 4000, np.random.default_rng(0)).points
    middle = points.mean(axis=0)
    axes = np.linalg.eigh((points - middle).T @ (points - middle))[1].T
    angles = np.radians(np.arange(0, 360, STEP))
    half = np.pi * np.concatenate([np.zeros((1, 3)), axes])
    turns = []
    for k in range(3):
        about = _make_about(angles[:, None] * axes[k], middle)
        for j in (0, 1 + (k + 1) % 3):
            turns.append(about @ _make_about(half[j : j + 1], middle))
    return np.concatenate(turns)


def _make_about(vectors: Floats, middle: Floats) -> Floats:
    """Rotations (K,4,4) by rotation vectors (K,3) about a point (3,)."""
    result = make_motions(np.column_stack([vectors, np.zeros((len(vectors), 3))]))
    result[:, :3, 3] = middle - result[:, :3, :3] @ middle
    return result
