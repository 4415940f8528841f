"""Patches of the scanned skin: mean distances of neighbouring points, which noise moves little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.duplicates import group_integers
from damageest.geometry.transforms import move_points
from damageest.geometry.voxels import number_faced_cubes
from damageest.stages.align.surface.plane_grid import PartSurface

EDGE = 4.0
"""Edge of a patch, in mean distances between points: about sixteen points on a face."""
MIN_POINTS = 6
"""Points below which a patch is not used."""
MAX_SCATTER = 2.5
"""Standard deviations of the noise by which the points of a flat patch may scatter about its mean."""
REACH = 8.0
"""Farthest distance from the skin, in tolerances, of the points that are averaged."""
MIN_VALUE = 1e-4
"""Smallest information about a motion, as a share of the largest one, for the skin to fix it at all. The facets of a
tessellated shaft give its rotation less, a keyway more."""


@dataclass(frozen=True)
class Patches:
    """P patches of the scan near the skin, in diagonals of the part.

    ``offset`` (P,): mean signed distance from the skin; ``jacobian`` (P,6): how a twist (rotation vector, translation)
    changes it; ``weight`` (P,): number of points, which stands for the area; ``is_flat`` (P,): whether the points
    scatter about the mean as noise does; ``basis`` (6,K): the motions that change distances, each by 1 in the mean
    square; ``place`` (P,3) on the skin, ``face`` (P,) of the part there.
    """

    offset: Floats
    jacobian: Floats
    weight: Floats
    is_flat: Flags
    basis: Floats
    place: Floats
    face: Ints

    @property
    def slopes(self) -> Floats:
        """(P,K) how each motion of the basis changes the offsets."""
        return np.asarray(self.jacobian @ self.basis)

    def move(self, motions: Floats) -> Floats:
        """(H,P) the offsets after motions (H,K), to first order."""
        return np.asarray(self.offset + motions @ self.slopes.T)


def measure_patches(target: PartSurface, points: Floats, pose: Floats, noise: float, tolerance: float) -> Patches:
    """Averages the distances of points (N,3), in a pose (4,4), over cubes, those of each direction of the skin apart.
    ``points``: spread evenly over the scanned area."""
    at = move_points(points, pose)
    distance, foot, face = target.closest(at)
    near = np.abs(distance) < REACH * tolerance
    if not near.any():
        none = np.zeros(0)
        return Patches(
            none, np.zeros((0, 6)), none, none > 0, np.zeros((6, 0)), np.zeros((0, 3)), np.zeros(0, np.int64)
        )
    distance, foot, face = distance[near], foot[near], face[near]
    normals = target.normals[face]
    edge = EDGE * float(np.sqrt(target.mesh.area / len(points)))
    key = number_faced_cubes(foot, normals, edge)[1]
    first, group, count = group_integers(key)
    many = count >= MIN_POINTS

    def average(values: Floats) -> Floats:
        return np.asarray(np.bincount(group, weights=values) / count)

    mean = average(distance)
    scatter = np.sqrt(np.maximum(average(distance**2) - mean**2, 0.0) * count / np.maximum(count - 1, 1))
    jacobian = np.column_stack([average(column) for column in (*np.cross(foot, normals).T, *normals.T)])
    usual = float(np.median(scatter[many])) if many.any() else 0.0
    is_flat = scatter < MAX_SCATTER * max(noise, usual)
    place = np.column_stack([average(column) for column in foot.T])
    weight = count[many].astype(float)
    basis = find_basis(jacobian[many], weight)
    return Patches(mean[many], jacobian[many], weight, is_flat[many], basis, place[many], face[first][many])


def find_basis(jacobian: Floats, weight: Floats) -> Floats:
    """The motions (6,K) that change the distances of the patches, or (F,K) among F motions; none of those that the
    part's symmetry allows."""
    if not len(weight):
        return np.empty((jacobian.shape[1], 0))
    values, vectors = np.linalg.eigh((jacobian * weight[:, None]).T @ jacobian / weight.sum())
    kept = values > MIN_VALUE * max(float(values[-1]), 1e-300)
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))
