"""Wear shallower than the tolerance: seen in the distance averaged over neighbours, not in single points.

The tolerance has to be as wide as the noise of a single point, some four standard deviations. The mean over k
neighbours on the same face has a k-th of the noise's variance, so it shows wear of three standard deviations, or two,
as plainly as single points show a pit. What limits it is no longer the noise but what is common to whole faces: the
error of the pose, the part's own deviations from the CAD, the chords of its triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Part, Scan
from damageest.geometry.voxels import CHUNK, number_cubes, number_faced_cubes

Flags = NDArray[np.bool_]

NEIGHBOURS = 48
"""Points averaged for the verdict on one."""
MIN_NEIGHBOURS = 12
"""With fewer of them, there is no verdict."""
REACH = 6.0
"""How far the neighbours may lie, in spacings of the scan: an even scan has twice as many as asked for there."""
SAME_FACE = 0.6
"""Neighbours' normals differ by less than this, as a vector; 35 degrees."""
CUBE = 4.0
"""Edge of the cubes that are averaged first, in spacings: some thirteen points on a face."""
NOISE_SHARE = 2.5
"""Standard deviations of the noise that a tolerance is meant to cover and a mean need not keep clear of. A tolerance of
four leaves one and a half: half the depth of wear of three, so that its rim comes out where it is."""
MIN_THRESHOLD = 0.35
"""Least threshold in tolerances, whatever the noise: it keeps clear of the pose's error."""
SAFETY = 2.0
"""How many times what deviates outward, where nothing is worn, wear has to deviate inward."""
NOISE = 2.0
"""Standard deviations that are taken for noise where neighbours are looked for."""
MIN_SIGMAS = 4.0
"""Standard deviations below which a cube's mean is not by chance: of a million cubes, at thirty."""
MIN_REGION = 100
"""Points of a worn region at least."""


@dataclass(frozen=True, eq=False)
class Wear:
    """``worn`` (N,) points, the ``threshold`` that their averaged distance was held against, and ``notes``."""

    worn: Flags
    threshold: float
    notes: tuple[str, ...] = ()


def find_wear(aligned: Scan, part: Part, distance: Floats, face: Ints, tolerance: float) -> Wear:
    """Which points lie in a region whose averaged distance shows it worn.

    Args:
        distance, face: (N,) of the scan's points, as in a Deviation. tolerance: lambda, in the job's unit.
    """
    none = np.zeros(len(distance), bool)
    # Without those that the noise takes beyond the tolerance, the mean would be too shallow.
    some = np.flatnonzero(np.abs(distance) < tolerance + 3 * aligned.noise)
    if not (aligned.noise and aligned.spacing) or len(some) < MIN_REGION:
        return Wear(none, tolerance)
    points, depth = aligned.points[some], distance[some]
    cross = part.cross[face[some]]
    normals = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
    # Neighbours along the surface: where points lie closer than the noise, the nearest in space are as deep as oneself.
    # Only by what is noise: beside a rim, points on the damage stay as far off as they lie deeper than that.
    noise = NOISE * aligned.noise
    points = points - np.clip(depth, -noise, noise)[:, None] * normals

    cube, group, mean, count = _average_cubes(points, normals, depth, CUBE * aligned.spacing)
    left = _measure_remaining(mean[count >= MIN_NEIGHBOURS], count[count >= MIN_NEIGHBOURS], aligned.noise)
    usual = max(tolerance - NOISE_SHARE * aligned.noise, MIN_THRESHOLD * tolerance, 1.5 * part.tessellation_error)
    threshold = max(usual, SAFETY * left)
    notes: tuple[str, ...] = ()
    if threshold > usual:
        notes = (
            f"sound surface lies up to {left:.3g} off the part over whole areas (pose, or the part's own form): wear "
            f"shallower than {min(threshold, tolerance):.3g} is not told from it",
        )
    if threshold >= tolerance:
        return Wear(none, threshold, notes)

    low = (count >= MIN_NEIGHBOURS // 2) & (
        mean < -np.maximum(0.6 * threshold, MIN_SIGMAS * aligned.noise / np.sqrt(count))
    )
    if not low.any():
        return Wear(none, threshold, notes)
    far = _count_cubes_away(cube, low)[group]
    asked, around = np.flatnonzero(far < 1.9), np.flatnonzero(far < 3.6)
    average, number = _average_neighbours(points, normals, depth, asked, around, REACH * aligned.spacing)
    below = average < -np.maximum(threshold, 4 * aligned.noise / np.sqrt(number))
    found = asked[below & (number >= MIN_NEIGHBOURS)]
    result = none.copy()
    result[some[found[_is_in_region(points[found], 2 * aligned.spacing)]]] = True
    return Wear(result, threshold, notes)


def _average_cubes(points: Floats, normals: Floats, depth: Floats, edge: float) -> tuple[Ints, Ints, Floats, Ints]:
    """Cubes (C,3) that hold points of one of six directions, the cube of each point (N,), and of each cube the mean
    ``depth`` and the number of its points (C,)."""
    cell, key = number_faced_cubes(points, normals, edge)
    _, first, group, count = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    return cell[first], group, np.bincount(group, weights=depth) / count, count


def _measure_remaining(mean: Floats, count: Ints, noise: float) -> float:
    """How far sound surface deviates outward over whole cubes, where nothing is worn: what the fit leaves."""
    outward = mean > 0
    if outward.sum() < 10:
        return 0.0
    high = float(np.quantile(mean[outward], 0.9))
    by_chance = 1.645 * noise / np.sqrt(float(np.median(count[outward])))  # the same quantile of the noise's half
    return float(np.sqrt(max(high**2 - by_chance**2, 0.0)))


def _count_cubes_away(cube: Ints, low: Flags) -> Floats:
    """(C,) how many cubes the nearest ``low`` one is away, centre to centre."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(cube[low]).query(cube, distance_upper_bound=4.0, workers=2)[0])


def _average_neighbours(
    points: Floats, normals: Floats, depth: Floats, asked: Ints, around: Ints, reach: float
) -> tuple[Floats, Ints]:
    """Mean depth (A,) of the nearest points ``around`` the ``asked`` ones on the same face, and how many they are."""
    from scipy.spatial import cKDTree

    # Direction as a fourth to sixth coordinate: across an edge or a thin wall nothing is near.
    place = np.concatenate([points, reach / SAME_FACE * normals], axis=1)
    count = min(NEIGHBOURS, len(around))
    tree = cKDTree(place[around])
    padded = np.append(depth[around], 0.0)  # the index of a missing neighbour is len(around)
    mean, number = np.empty(len(asked)), np.empty(len(asked), np.int64)
    for start in range(0, len(asked), CHUNK):
        own = slice(start, start + CHUNK)
        gap, index = tree.query(place[asked[own]], k=[*range(1, count + 1)], distance_upper_bound=reach, workers=2)
        number[own] = np.maximum(np.isfinite(gap).sum(axis=1), 1)
        mean[own] = padded[index].sum(axis=1) / number[own]
    return mean, number


def _is_in_region(points: Floats, link: float) -> Flags:
    """(M,) which of the points lie in a region, with the gaps that a ``link`` bridges, that has enough of them."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(points) < MIN_REGION:
        return np.zeros(len(points), bool)
    cell, key = number_cubes(points, link)
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    pairs = cKDTree(cell[first]).query_pairs(1.9, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(first), len(first)))
    region = connected_components(links, directed=False)[1][group]
    return np.asarray(np.bincount(region)[region] >= MIN_REGION)
