"""Which points lie near others: nearest neighbours, points near given places, thinning, the area per point.

All lengths and points of a call are in one unit and one frame.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import group_integers
from damageest.geometry.threads import count_threads
from damageest.geometry.voxels import CHUNK, MOST_ALONG, VoxelGrid, measure_bounds, number_cubes, order_by_place
from damageest.isolation.memory import FEWER_POINTS, require_memory

BYTES_OF_PLACE = 60
"""Memory of a search for each point, beside its neighbours, and for each point that may be one, measured."""

MANY = 20_000
"""Points from which a tree and its queries are made for speed."""
SOME = 200_000
"""Number of points that tell how dense a scan of more points is."""
WHOLE = 100_000
"""Points up to which a tree over all of them is made for a few places: it takes less than to look which are near."""


def find_nearby(points: Floats, places: Floats, reach: float) -> Ints:
    """Ascending indices of all points (N,3) within ``reach`` of one of the places (M,3), and of some farther away.

    By a voxel grid with cubes at least as large as ``reach``: a point is included if its cube holds a place or touches
    a cube that does. So within ``reach`` of a place, its nearest neighbours among these points are those among all.
    """
    if not len(places) or not len(points):
        return np.empty(0, np.int64)
    low, high = measure_bounds(places)
    size = max(reach * (1 + 1e-9), float((high - low).max()) / MOST_ALONG, 1e-300)
    # two empty layers on every side: one for the cubes next to the places, one for all points farther away
    low = low - 2 * size
    shape = np.floor((high - low) / size).astype(np.int64) + 3
    grid = VoxelGrid(low, size, shape)
    is_near = grid.mark_around(places, 1)
    found = []
    for start in range(0, len(points), CHUNK):
        found.append(start + np.flatnonzero(is_near[grid.number_cells(points[start : start + CHUNK])]))
    return np.concatenate(found)


def gather_around(points: Floats, places: Floats, count: int, rng: np.random.Generator) -> Ints:
    """Ascending indices of points (N,3) that include the ``count`` nearest ones of nearly every one of the few places
    (M,3); for a tree over very many points, which takes seconds.

    How far these are is estimated from `SOME` points drawn at random; of few points, all are taken.
    """
    if len(points) <= 10 * count or not len(places):
        return np.arange(len(points) if len(places) else 0)
    some = points[rng.integers(0, len(points), SOME)]
    enough = max(3, math.ceil(1.3 * count * len(some) / len(points)))
    reach = query_neighbours(make_tree(some), places, enough + 1)[0][:, -1]
    return find_nearby(points, places, float(np.percentile(reach, 95)))


def query_at_few(points: Floats, places: Floats, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Distances (M,count) and points (M,count,3), relative to the first place, of the nearest of the points (N,3) to
    each of a few places (M,3), nearest first; of very many points, of nearly every place."""
    around = points[gather_around(points, places, count, rng)] if len(points) > WHOLE else points
    middle = places[:1].sum(axis=0)  # far from the origin, products of coordinates lose digits
    near = around - middle
    distance, index = query_neighbours(make_tree(near), places - middle, count)
    return distance, near[index]


def find_in_box(points: Floats, low: Floats, high: Floats) -> Ints:
    """Ascending indices of the points (N,3) strictly inside the box from ``low`` (3,) to ``high`` (3,)."""
    index = np.flatnonzero((points[:, 0] > low[0]) & (points[:, 0] < high[0]))
    for axis in (1, 2):
        along = points[index, axis]
        index = index[(along > low[axis]) & (along < high[axis])]
    return index


def thin_points(points: Floats, cell: float) -> tuple[Floats, Ints, Ints]:
    """Points (N,3) thinned to their mean in each cube of edge ``cell``.

    Returns:
        The means (M,3), how many points each is the mean of (M,), and the index (M,) of the first of these points.
    """
    first, group, counts = group_integers(number_cubes(points, cell)[1])
    sums = np.stack([np.bincount(group, points[:, axis]) for axis in range(3)], axis=1)
    return sums / counts[:, None], counts, first


def pick_one_per_cube(points: Floats, cell: float) -> Ints:
    """Ascending indices (M,) of the first of the points (N,3) in each cube of edge ``cell``."""
    return np.sort(group_integers(number_cubes(points, cell)[1])[0])


def pick_at_most(points: Floats, cell: float, most: int, growth: float) -> Ints:
    """As `pick_one_per_cube`, in cubes whose edge grows from ``cell`` by the factor ``growth`` until ``most`` points
    are left at most."""
    chosen = pick_one_per_cube(points, cell)
    while len(chosen) > most:
        cell *= growth
        chosen = pick_one_per_cube(points, cell)
    return chosen


def find_neighbours(
    points: Floats, count: int, among: Floats | None = None, reach: float = np.inf
) -> tuple[Floats, Ints]:
    """The nearest neighbours of each of the points (N,3): distances (N,count) and indices (N,count), nearest first.

    Args:
        count: neighbours wanted; fewer columns where there are fewer points to find.
        among: (M,3) the points to find; by default the points themselves, so that each point is its own first
            neighbour.
        reach: beyond this distance none is found: the distance is infinite and the index M.
    """
    among = points if among is None else among
    count = min(count, len(among))
    needed = (16 * count + BYTES_OF_PLACE) * len(points) + BYTES_OF_PLACE * len(among)
    require_memory(needed, f"the {count} nearest neighbours of {len(points):,} points", FEWER_POINTS)
    return query_neighbours(make_tree(among), points, count, reach)


def make_tree(points: Floats) -> Any:
    """A k-d tree over points (N,D) for `query_neighbours`.

    Of many points it is built by halving cells, not by medians: that takes half the time.
    """
    from scipy.spatial import cKDTree

    plain = len(points) < MANY
    return cKDTree(points, balanced_tree=plain, compact_nodes=plain)


def query_neighbours(tree: Any, points: Floats, count: int, reach: float = np.inf) -> tuple[Floats, Ints]:
    """As `find_neighbours`, among the points of a tree of `make_tree` that has at least ``count``."""
    shape = (len(points), count)
    if not count:
        return np.empty(shape), np.empty(shape, np.int64)
    if len(points) < MANY:
        distance, index = tree.query(points, k=count, distance_upper_bound=reach, workers=count_threads())
        return np.reshape(distance, shape), np.reshape(index, shape)
    order = order_by_place(points[:, :3])
    distance, index = np.empty(shape), np.empty(shape, np.intp)
    for start in range(0, len(order), CHUNK):
        some = order[start : start + CHUNK]
        found = tree.query(points[some], k=count, distance_upper_bound=reach, workers=count_threads())
        distance[some], index[some] = (np.reshape(of_some, (len(some), count)) for of_some in found)
    return distance, index


def measure_local_areas(points: Floats, among: Floats | None = None) -> Floats:
    """The area (N,) of surface that each of the points (N,3) stands for, from its eight nearest neighbours.

    ``among`` (M,3): the points that have these neighbours, the points themselves with them; by default only these.
    At most four times the median of all, so that single outliers stay small. In the square of the points' unit; 1e-12
    each for fewer than three points.
    """
    if not len(points) or len(points if among is None else among) < 3:
        return np.full(len(points), 1e-12)
    distance, _ = find_neighbours(points, 9, among)
    count = distance.shape[1] - 1
    area = np.pi * distance[:, -1] ** 2 / count
    return np.asarray(np.minimum(area, 4 * np.median(area)))
