"""The last step of the fit: patches whose mean deviates get no weight, even where their single points do not
deviate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.transforms import make_motions, move_points
from damageest.geometry.voxels import number_faced_cubes
from damageest.stages.align.refine.robust_fit import REACH, Fit, solve_gauss_newton
from damageest.stages.align.surface.plane_grid import PartSurface

PATCH = 4.0
"""Edge of the cubes, in mean distances between points: about sixteen points on a face."""
MIN_POINTS = 6


def refine_pose(target: PartSurface, points: Floats, best: Fit, rounds: int = 8) -> Fit:
    """Continues the fit from ``best``, with each point also weighted by the mean distance of its patch.

    Wear of three standard deviations of the noise is within the kernel for single points and shifts the pose. The mean
    over a patch of k points has 1/k of the variance, so the kernel for patches is narrower and excludes the wear.
    """
    pose = best.pose
    edge = PATCH * float(np.sqrt(target.mesh.area / len(points)))
    distance, foot, face = target.closest(move_points(points, pose))
    within = np.abs(distance) < best.band
    points, foot, face = points[within], foot[within], face[within]
    normals = target.normals[face]
    patch = np.unique(number_faced_cubes(move_points(points, pose), normals, edge)[1], return_inverse=True)[1]
    count = np.bincount(patch)
    many = count >= MIN_POINTS
    if many.sum() < 30:
        return best
    for _ in range(rounds):
        at = move_points(points, pose)
        offset = np.einsum("ij,ij->i", normals, at - foot)
        mean = np.bincount(patch, weights=offset) / np.maximum(count, 1)
        band = REACH * 1.4826 * float(np.median(np.abs(mean[many])))
        share = np.maximum(1 - (mean / max(band, 1e-12)) ** 2, 0) ** 2 * many
        weight = (1 - np.minimum(np.abs(offset) / best.band, 1) ** 2) ** 2 * share[patch]
        twist, _ = solve_gauss_newton(at, normals, weight, offset)
        pose = make_motions(twist[None])[0] @ pose
        if float(np.abs(twist).max()) < 1e-3 * band:
            break
    return replace(best, pose=pose)
