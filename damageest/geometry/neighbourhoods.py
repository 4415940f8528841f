"""Which points lie near which: neighbours, thinning, the area that a point stands for, points near places."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.voxels import CHUNK, MOST_ALONG, VoxelGrid, number_cubes


def find_nearby(points: Floats, places: Floats, reach: float) -> Ints:
    """Ascending indices of all points (N,3) within ``reach`` of one of the places (M,3), and of some farther off.

    By a lattice of cubes no smaller than the reach: a point counts where its cube holds a place or touches one that
    does. So the nearest neighbours of a place among these points are those among all, as far as the reach goes.
    """
    if not len(places) or not len(points):
        return np.empty(0, np.int64)
    low, high = places.min(axis=0), places.max(axis=0)
    size = max(reach * (1 + 1e-9), float((high - low).max()) / MOST_ALONG, 1e-300)
    # two empty layers all round: one that the places' neighbours may reach into, one for whatever lies beyond
    low = low - 2 * size
    shape = np.floor((high - low) / size).astype(np.int64) + 3
    lattice = VoxelGrid(low, size, shape)
    taken = lattice.mark_around(places, 1)
    found = []
    for start in range(0, len(points), CHUNK):
        found.append(start + np.flatnonzero(taken[lattice.number_cells(points[start : start + CHUNK])]))
    return np.concatenate(found)


def find_in_box(points: Floats, low: Floats, high: Floats) -> Ints:
    """Ascending indices of the points (N,3) strictly inside a box."""
    index = np.flatnonzero((points[:, 0] > low[0]) & (points[:, 0] < high[0]))
    for axis in (1, 2):
        along = points[index, axis]
        index = index[(along > low[axis]) & (along < high[axis])]
    return index


def thin_points(points: Floats, cell: float) -> tuple[Floats, Ints, Ints]:
    """Means (M,3) of the points (N,3) in each cube of edge ``cell``, how many each stands for, and one of those."""
    _, first, group, counts = np.unique(
        number_cubes(points, cell)[1], return_index=True, return_inverse=True, return_counts=True
    )
    sums = np.stack([np.bincount(group, points[:, axis]) for axis in range(3)], axis=1)
    return sums / counts[:, None], counts.astype(np.int64), first


def pick_one_per_cube(points: Floats, cell: float) -> Ints:
    """Index of the first of the points (N,3) in each cube of edge ``cell``."""
    return np.sort(np.unique(number_cubes(points, cell)[1], return_index=True)[1])


def find_neighbours(
    points: Floats, count: int, among: Floats | None = None, reach: float = np.inf
) -> tuple[Floats, Ints]:
    """Distances and indices (N,count) of each point's nearest ``among`` others, or among all, itself first. Beyond
    ``reach`` the distance is infinite and the index no point's."""
    from scipy.spatial import cKDTree

    among = points if among is None else among
    count = min(count, len(among))
    distance, index = cKDTree(among).query(points, k=count, distance_upper_bound=reach, workers=2)
    return np.reshape(distance, (len(points), count)), np.reshape(index, (len(points), count))


def measure_local_areas(points: Floats) -> Floats:
    """Area (N,) that each of the points on a surface stands for, from its eight nearest."""
    if len(points) < 3:
        return np.full(len(points), 1e-12)
    distance, _ = find_neighbours(points, 9)
    count = distance.shape[1] - 1
    area = np.pi * distance[:, -1] ** 2 / count
    return np.asarray(np.minimum(area, 4 * np.median(area)))
