"""Which way is out of a closed surface of points: where the open air is."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import InputError
from damageest.geometry.poisson import Grid

MAX_VOXELS = 60_000_000


def turn_outward(points: Floats, normals: Floats, voxel: float) -> Floats:
    """Turns normals (N,3) of either sign out of the body whose whole surface the points (N,3) lie on.

    Voxels that hold a point, and those beside them, make a shell of some three voxels; air that reaches the box's
    walls is outside, the rest inside. Each point counts, along its normal, the air to either side just past the shell.
    Raises InputError where the shell leaks, so that there is no inside, or the grid would not fit in memory.
    """
    from scipy import ndimage
    from scipy.spatial import cKDTree

    low = points.min(axis=0) - 4 * voxel
    shape = np.ceil((points.max(axis=0) - low) / voxel).astype(np.int64) + 5
    if np.prod(shape.astype(float)) > MAX_VOXELS:
        raise InputError(
            f"the specimen would need {np.prod(shape.astype(float)):.3g} voxels of {voxel:.3g}, "
            f"{MAX_VOXELS:.3g} at most; set part.cell larger"
        )
    grid = Grid(low, voxel, (int(shape[0]), int(shape[1]), int(shape[2])))
    shell = np.zeros(grid.shape, bool)
    shell[tuple(np.rint((points - low) / voxel).astype(np.int64).T)] = True
    shell = ndimage.binary_dilation(shell, np.ones((3, 3, 3), bool))
    label, _ = ndimage.label(~shell)
    air = label == label[0, 0, 0]
    inside = ~shell & ~air
    if inside.sum() < 8:
        raise InputError(
            f"the specimen's scan encloses nothing at a resolution of {voxel:.3g}: it leaves openings wider than "
            f"{3 * voxel:.3g}, or walls are thinner than that; scan it all round, or set part.cell"
        )
    # The side on which the air is nearer than the inside: distances to both just off the point.
    to_air = ndimage.distance_transform_edt(~air).astype(np.float32)
    to_inside = ndimage.distance_transform_edt(~inside).astype(np.float32)
    vote = np.zeros(len(points))
    for step in (1.0, 2.0):
        for sign in (1.0, -1.0):
            at = tuple(np.rint((points + sign * step * voxel * normals - low) / voxel).astype(np.int64).T)
            vote += sign * (to_inside[at] - to_air[at])
    thin = to_inside[tuple(np.rint((points - low) / voxel).astype(np.int64).T)] > 6
    # Beside a thin edge the nearest air still tells the side; where much is thin, it may be a leak's.
    if thin.mean() > 0.1:
        middle = points[np.flatnonzero(thin)[0]]
        raise InputError(
            f"the specimen's walls are thinner than its scan resolves ({3 * voxel:.3g}), or it has openings, at "
            f"{100 * thin.mean():.1f} % of its points, as at ({middle[0]:.4g}, {middle[1]:.4g}, {middle[2]:.4g}); "
            "scan more points there, or set part.cell smaller"
        )
    # Neighbours on the same face settle where a point's own air is even.
    _, near = cKDTree(points).query(points, k=9, workers=2)
    agree = np.einsum("ij,ikj->ik", normals, normals[near])
    vote = (vote[near] * agree).sum(axis=1)
    return np.where(vote < 0, -1.0, 1.0)[:, None] * normals
