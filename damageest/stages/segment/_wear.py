"""Finds wear shallower than the tolerance: the mean distance over neighbours shows it, single points do not.

The tolerance must cover the noise of a single point, about four standard deviations. The mean over k neighbours on the
same face has 1/k of the variance, so it shows wear of two or three standard deviations as clearly as single points show
a pit. The limit is then set by errors that are common to whole faces: the error of the pose, deviations of the part
from its CAD model, the chords of the triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Scan
from damageest.geometry.duplicates import group_integers
from damageest.geometry.patches import Patches
from damageest.geometry.threads import count_threads
from damageest.geometry.voxels import CHUNK, number_cubes, number_faced_cubes
from damageest.isolation.memory import FEWER_POINTS, require_memory

NEIGHBOURS = 48
"""Largest number of points that a mean is taken over."""
MIN_NEIGHBOURS = 12
"""Smallest number of points that a mean is taken over."""
REACH = 6.0
"""Largest distance of the neighbours, in spacings of the scan: an even scan has twice `NEIGHBOURS` points there."""
SAME_FACE = 0.6
"""Largest length of the difference between the normals of neighbours; 35 degrees."""
CUBE = 4.0
"""Edge of the cubes that are averaged first, in spacings: about thirteen points on a face."""
COVERED_NOISE = 2.5
"""Standard deviations of the noise that the threshold of a mean may be below the tolerance. A tolerance of four gives a
threshold of 1.5: half the depth of wear of three, so that its rim is found in the right place."""
MIN_THRESHOLD = 0.35
"""Smallest threshold, in tolerances, at any noise; it must be above the error of the pose."""
SAFETY = 2.0
"""How many times deeper wear must be than the outward deviation of intact surface."""
NOISE = 2.0
"""Standard deviations of a distance that are removed as noise before neighbours are searched."""
MIN_SIGMAS = 4.0
"""Standard deviations below which the mean of a cube is significant; by chance, thirty in a million cubes are."""
MIN_REGION = 100
"""Smallest number of points of a worn region."""


BYTES_OF_POINT = 150
"""Memory for each point near the skin, measured."""


@dataclass(frozen=True, eq=False)
class Wear:
    """``worn`` (N,): whether each point is worn; ``threshold``: depth of the mean from which it is; ``notes``."""

    worn: Flags
    threshold: float
    notes: tuple[str, ...] = ()


def find_wear(aligned: Scan, part: Part, distance: Floats, face: Ints, tolerance: float) -> Wear:
    """Finds the points in regions whose mean distance shows wear.

    Args:
        aligned: the scan, N points, with noise and spacing measured.
        part: the part as designed.
        distance: (N,) signed distances, positive outside, in the job's unit.
        face: (N,) nearest triangle of the part.
        tolerance: distance from which a single point is damage.
    """
    none = np.zeros(len(distance), bool)
    # Also points that noise moves beyond the tolerance: without them the mean would be too shallow.
    some = np.flatnonzero(np.abs(distance) < tolerance + 3 * aligned.noise)
    if not (aligned.noise and aligned.spacing) or len(some) < MIN_REGION:
        return Wear(none, tolerance)
    require_memory(BYTES_OF_POINT * len(some), f"the search for wear among {len(some):,} points", FEWER_POINTS)
    points, depth = aligned.points[some], distance[some]
    normals = part.face_normals[face[some]]
    # Neighbours are searched along the surface: in a dense scan the nearest points in space have the same noise.
    # Only noise is removed from the positions: points deeper than that stay apart from those beside the rim.
    noise = NOISE * aligned.noise
    points = points - np.clip(depth, -noise, noise)[:, None] * normals

    cube, group, mean, count = _average_cubes(points, normals, depth, CUBE * aligned.spacing)
    left = _measure_remaining(mean[count >= MIN_NEIGHBOURS], count[count >= MIN_NEIGHBOURS], aligned.noise)
    base = max(tolerance - COVERED_NOISE * aligned.noise, MIN_THRESHOLD * tolerance, 1.5 * part.tessellation_error)
    threshold = max(base, SAFETY * left)
    notes: tuple[str, ...] = ()
    if threshold > base:
        notes = (
            f"intact surface deviates by up to {left:.3g} over whole areas (pose or form): wear shallower than "
            f"{min(threshold, tolerance):.3g} is not found; check pose and form of the part in the report",
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
    """Averages over cubes, with the points of each of six directions of the normal apart.

    Returns:
        The cells (C,3) of the cubes, the cube (N,) of each point, the mean ``depth`` (C,) of each cube and the number
        (C,) of its points.
    """
    cell, key = number_faced_cubes(points, normals, edge)
    cubes = Patches.of_equal(key)
    return cell[cubes.first], cubes.group, cubes.mean(depth), cubes.count


def _measure_remaining(mean: Floats, count: Ints, noise: float) -> float:
    """How far intact surface deviates outward over whole cubes: the error that the alignment leaves."""
    outward = mean > 0
    if outward.sum() < 10:
        return 0.0
    high = float(np.quantile(mean[outward], 0.9))
    by_chance = 1.645 * noise / np.sqrt(float(np.median(count[outward])))  # the same quantile of the noise's half
    return float(np.sqrt(max(high**2 - by_chance**2, 0.0)))


def _count_cubes_away(cube: Ints, low: Flags) -> Floats:
    """(C,) distance from each cube to the nearest ``low`` one, between centres, in cubes."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(cube[low]).query(cube, distance_upper_bound=4.0, workers=count_threads())[0])


def _average_neighbours(
    points: Floats, normals: Floats, depth: Floats, asked: Ints, around: Ints, reach: float
) -> tuple[Floats, Ints]:
    """Mean depth (A,) of the nearest points on the same face, and their number (A,).

    ``asked`` (A,): points to find it for; ``around`` (B,): points to average; ``reach``: largest distance.
    """
    from scipy.spatial import cKDTree

    # The normal is the fourth to sixth coordinate: points across an edge or a thin wall are then not near.
    place = np.concatenate([points, reach / SAME_FACE * normals], axis=1)
    count = min(NEIGHBOURS, len(around))
    tree = cKDTree(place[around])
    padded = np.append(depth[around], 0.0)  # the index of a missing neighbour is len(around)
    mean, number = np.empty(len(asked)), np.empty(len(asked), np.int64)
    for start in range(0, len(asked), CHUNK):
        own = slice(start, start + CHUNK)
        gap, index = tree.query(
            place[asked[own]], k=[*range(1, count + 1)], distance_upper_bound=reach, workers=count_threads()
        )
        number[own] = np.maximum(np.isfinite(gap).sum(axis=1), 1)
        mean[own] = padded[index].sum(axis=1) / number[own]
    return mean, number


def _is_in_region(points: Floats, link: float) -> Flags:
    """(M,) whether each point lies in a region of enough points; gaps up to ``link`` connect."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if len(points) < MIN_REGION:
        return np.zeros(len(points), bool)
    cell, key = number_cubes(points, link)
    first, group, _ = group_integers(key)
    pairs = cKDTree(cell[first]).query_pairs(1.9, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(first), len(first)))
    region = connected_components(links, directed=False)[1][group]
    return np.asarray(np.bincount(region)[region] >= MIN_REGION)
