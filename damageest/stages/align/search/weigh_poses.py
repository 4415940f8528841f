"""Which of two poses the scan favours, by the patches that distinguish them and by the noise of patches."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import group_integers
from damageest.geometry.transforms import move_points
from damageest.geometry.voxels import number_cubes, number_faced_cubes
from damageest.stages.align.surface.plane_grid import PartSurface

POINTS = 8000
"""Number of scan points that two poses are compared with."""
NEIGHBOUR, EDGE = 8, 2.5
"""A patch is this many distances to that neighbour wide: about sixteen points on a face."""
MIN_POINTS = 4
BLOCK = 4.0
"""Edge of the blocks whose means show how far the errors of neighbouring patches are alike, in patches."""
TELLING = 2.0
"""Difference of a patch's distances in the two poses, in standard deviations of patches, from which it tells the poses
apart."""
MOST_INSIDE, MOST_OUTSIDE = 4.5, 9.0
"""Largest weight of a patch, as the logarithm of odds: a loss explains a patch that lies inside, nothing explains one
that lies outside."""
DECISIVE = 8.0
"""Logarithm of the odds from which one pose is right and the other is not."""


def weigh_poses(target: PartSurface, points: Floats, pose: Floats, others: Floats, noise: float) -> Floats:
    """By how much the scan favours ``pose`` (4,4) over each of the ``others`` (K,4,4): logarithms of the odds (K,).

    Single points are no independent witnesses: a scanner's steps and waves move neighbours alike. So points are
    averaged over patches, the scatter of the patches is measured and not derived from the noise, and the sum is divided
    by the number of patches that deviate alike. Patches on which the poses hardly differ have no say.
    ``points`` (N,3): in random order, spread evenly over the scan; lengths in diagonals of the part.
    """
    if not len(others):
        return np.zeros(0)
    some = points[:POINTS]
    patch, place, count = _group_points(target, some, pose)
    if not len(count):
        return np.zeros(len(others))
    first, *seconds = _average(target, some, np.concatenate([pose[None], others]), patch, len(count))
    scatter = max(1.4826 * float(np.median(np.abs(first))), noise / float(np.sqrt(np.median(count))), 1e-5)
    here, alike = _weigh(first / scatter), _count_alike(first / scatter, place)
    gains = [
        float((_weigh(second / scatter) - here)[np.abs(first - second) > TELLING * scatter].sum()) for second in seconds
    ]
    return np.array(gains) / alike


def _group_points(target: PartSurface, points: Floats, pose: Floats) -> tuple[Ints, Floats, Ints]:
    """The patch of each point (N,), -1 for none; for each patch its place (P,3), in edges of patches, and the number of
    its points (P,)."""
    from scipy.spatial import cKDTree

    if len(points) <= NEIGHBOUR:
        return np.full(len(points), -1), np.zeros((0, 3)), np.zeros(0, np.int64)
    at = move_points(points, pose)
    reach = np.asarray(cKDTree(at).query(at[:1000], k=NEIGHBOUR + 1)[0])[:, -1]
    edge = EDGE * max(float(np.median(reach)), 1e-9)
    _, _, face = target.closest(at)
    key = number_faced_cubes(at, target.normals[face], edge)[1]
    _, group, count = group_integers(key)
    kept = np.flatnonzero(count >= MIN_POINTS)
    number = np.full(len(count), -1)
    number[kept] = np.arange(len(kept))
    patch = number[group]
    inside = patch >= 0
    place = np.column_stack([np.bincount(patch[inside], column[inside], len(kept)) for column in at.T])
    return patch, place / np.maximum(count[kept], 1)[:, None] / edge, count[kept]


def _average(target: PartSurface, points: Floats, poses: Floats, patch: Ints, count: int) -> Floats:
    """The mean signed distance of each patch in each of the poses (H,4,4): (H,P)."""
    inside = patch >= 0
    moved = [move_points(points[inside], pose) for pose in poses]
    distance = target.closest(np.concatenate(moved))[0].reshape(len(poses), -1)
    number = patch[inside]
    size = np.bincount(number, minlength=count)
    return np.array([np.bincount(number, one, count) / size for one in distance])


def _weigh(size: Floats) -> Floats:
    """What patches that lie ``size`` (P,) standard deviations outside cost, as logarithms of odds."""
    return np.asarray(np.minimum(size**2 / 2, np.where(size > 0, MOST_OUTSIDE, MOST_INSIDE)))


def _count_alike(size: Floats, place: Floats) -> float:
    """How many neighbouring patches deviate alike: 1 where the errors of patches are independent."""
    near = np.abs(size) < 3
    if near.sum() < 20:
        return 1.0
    size, block = size[near], group_integers(number_cubes(place[near], BLOCK)[1])[1]
    count = np.bincount(block)
    many = count >= MIN_POINTS
    if many.sum() < 5:
        return 1.0
    mean = (np.bincount(block, size) / count)[many]
    expected = float((size**2).mean() / count[many].mean())
    return float(np.clip((mean**2).mean() / max(expected, 1e-300), 1.0, count[many].mean()))
