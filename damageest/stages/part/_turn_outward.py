"""Orients the normals of a closed surface of points: outward is where the empty space around it is."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import InputError
from damageest.geometry.poisson import Grid
from damageest.geometry.threads import count_threads

MAX_VOXELS = 60_000_000


def turn_outward(points: Floats, normals: Floats, voxel: float) -> Floats:
    """Flips normals (N,3) of any sign so that they point out of the body whose whole surface the points (N,3) cover.

    Voxels with a point and their neighbours make a shell about three voxels thick. Empty space connected to the border
    of the grid is outside, the rest inside. Each normal points to the side of its point where the outside is nearer.
    Raises InputError where the shell has openings, so that there is no inside, or the grid would not fit in memory.
    """
    from scipy import ndimage
    from scipy.spatial import cKDTree

    low = points.min(axis=0) - 4 * voxel
    shape = np.ceil((points.max(axis=0) - low) / voxel).astype(np.int64) + 5
    if np.prod(shape.astype(float)) > MAX_VOXELS:
        raise InputError(
            f"the specimen would need {np.prod(shape.astype(float)):.3g} voxels of {voxel:.3g}, more than the limit "
            f"of {MAX_VOXELS:.3g}; set part.cell larger"
        )
    grid = Grid(low, voxel, (int(shape[0]), int(shape[1]), int(shape[2])))
    shell = np.zeros(grid.shape, bool)
    shell[tuple(np.rint((points - low) / voxel).astype(np.int64).T)] = True
    shell = ndimage.binary_dilation(shell, np.ones((3, 3, 3), bool))
    label, _ = ndimage.label(~shell)
    outside = label == label[0, 0, 0]
    inside = ~shell & ~outside
    if inside.sum() < 8:
        raise InputError(
            f"the specimen's scan encloses no volume: openings wider than {3 * voxel:.3g}, or thinner walls; scan it "
            "from all sides, or set part.cell"
        )
    # Outward is the side where the outside is nearer than the inside: distances to both near the point.
    to_outside = ndimage.distance_transform_edt(~outside).astype(np.float32)
    to_inside = ndimage.distance_transform_edt(~inside).astype(np.float32)
    score = np.zeros(len(points))
    for step in (1.0, 2.0):
        for sign in (1.0, -1.0):
            at = tuple(np.rint((points + sign * step * voxel * normals - low) / voxel).astype(np.int64).T)
            score += sign * (to_inside[at] - to_outside[at])
    thin = to_inside[tuple(np.rint((points - low) / voxel).astype(np.int64).T)] > 6
    # Beside a thin edge the nearest outside still gives the side; where many points are thin, it may be wrong.
    if thin.mean() > 0.1:
        middle = points[np.flatnonzero(thin)[0]]
        raise InputError(
            f"walls thinner than the scan resolves ({3 * voxel:.3g}), or openings, at {100 * thin.mean():.1f} % of the "
            f"points, for example at ({middle[0]:.4g}, {middle[1]:.4g}, "
            f"{middle[2]:.4g}); scan more points there, or set part.cell smaller"
        )
    # The sum over neighbours on the same face decides where the score of a single point is near 0.
    _, near = cKDTree(points).query(points, k=9, workers=count_threads())
    agree = np.einsum("ij,ikj->ik", normals, normals[near])
    score = (score[near] * agree).sum(axis=1)
    return np.where(score < 0, -1.0, 1.0)[:, None] * normals
