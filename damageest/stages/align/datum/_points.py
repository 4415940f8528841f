"""The scan points on one datum of a system, averaged in patches.

Lengths in diagonals of the part.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.errors import StageError
from damageest.geometry.duplicates import group_integers
from damageest.geometry.voxels import number_faced_cubes
from damageest.stages.align.datum.system import Feature
from damageest.stages.align.wear.skin_patches import Patches

PATCHES = 60
"""Patches that a datum is divided in where it has few points; of many points, sixteen make a patch."""
POINTS = 16
MIN_INNER = 0.4
"""Share of a datum's points that has to lie off its rim, for those on the rim to be left out."""
MIN_POINTS = 20
"""Points on a datum, below which the scan does not show it."""
MAX_SCATTER = 2.5
"""Standard deviations of the noise by which the points of a flat patch may scatter about its mean."""


@dataclass(frozen=True, eq=False)
class OnDatum:
    """The patches of a datum, their basis still empty; ``sizes``: columns of radii at the end of the jacobian;
    ``points``: how many points lie on it; ``edge`` of a patch."""

    patches: Patches
    sizes: int
    points: int
    edge: float


def gather_points(feature: Feature, at: Floats, shape: Ints, distance: Floats, noise: float, margin: float) -> OnDatum:
    """Averages the points ``at`` (N,3), which lie on the ``shape`` (N,) of a datum, -1 for none; ``distance`` (N,) from
    the part. Points within ``margin`` of the rim of a face are left out where others are as many: worn skin beside the
    datum lies there. Raises StageError where they are too few."""
    offset, normals = np.zeros(len(at)), np.zeros((len(at), 3))
    for number, one in enumerate(feature.shapes):
        own = shape == number
        offset[own], normals[own] = one.measure(at[own])
    # beyond the rim of a face the part is farther than its shape; there the points belong to another face
    kept = (shape >= 0) & (np.abs(distance) - np.abs(offset) < max(noise, 1e-5))
    index = np.flatnonzero(kept)
    inner = feature.is_inner(at[index] - offset[index, None] * normals[index], margin)
    if inner.sum() > max(MIN_INNER * len(index), MIN_POINTS):
        kept[index[~inner]] = False
    count_points = int(kept.sum())
    if count_points < MIN_POINTS:
        raise StageError(
            f"the scan does not show datum {feature.name}: {count_points} of its points lie there, and {MIN_POINTS} "
            "are needed",
            "scan the datum, or name others in align.datum; `damageest faces` lists the CAD faces",
            topic="wear",
        )
    at, shape, offset, normals = at[kept], shape[kept], offset[kept], normals[kept]
    of_patch = float(np.clip(count_points / PATCHES, 1, POINTS))
    extents = [np.ptp(at[shape == number], axis=0) for number in np.unique(shape)]
    edge = float(np.sqrt(of_patch / count_points * np.sum(np.square(extents)) / 2)) + 1e-12
    foot = at - offset[:, None] * normals
    key = number_faced_cubes(foot, normals, edge)[1] * len(feature.shapes) + shape
    first, group, count = group_integers(key)

    def average(values: Floats) -> Floats:
        return np.asarray(np.bincount(group, weights=values) / count)

    mean = average(offset)
    scatter = np.sqrt(np.maximum(average(offset**2) - mean**2, 0.0) * count / np.maximum(count - 1, 1))
    usual = float(np.median(scatter))
    radii = [number for number, one in enumerate(feature.shapes) if one.has_radius]
    columns = [*np.cross(at, normals).T, *normals.T]
    columns += [np.where(shape == number, -feature.shapes[number].sign, 0.0) for number in radii]
    jacobian = np.column_stack([average(column) for column in columns])
    place = np.column_stack([average(column) for column in foot.T])
    patches = Patches(
        mean, jacobian, count.astype(float), scatter < MAX_SCATTER * max(noise, usual),
        np.empty((jacobian.shape[1], 0)), place, shape[first],
    )  # fmt: skip
    return OnDatum(patches, len(radii), count_points, edge)
