"""Density clustering (DBSCAN) with bounded memory."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.patches import Patches
from damageest.geometry.threads import count_threads
from damageest.isolation.memory import FEWER_POINTS, require_memory

MAX_PAIRS = 20_000_000
"""Largest number of pairs of neighbours in memory, see `PAIR_BYTES`; with more, points are first averaged in a grid."""


PAIR_BYTES, POINT_BYTES = 66, 60
"""Memory for each pair and each point, measured."""
REMEDY = "a smaller cluster.eps, " + FEWER_POINTS


def run_dbscan(points: Floats, eps: float, neighbours: int) -> Ints:
    """The cluster number (M,) of each of ``points`` (M,3), from 0, -1 for noise (Ester et al. 1996).

    A point is dense where at least ``neighbours`` points, itself included, are within ``eps``. A border point belongs
    to the cluster of its nearest dense point. Where the pairs of points would not fit in memory, the points in one cell
    of a grid of eps/4 count as one point with their number as weight; distances are then exact within the size of a
    cell.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    of = np.arange(len(points))
    weight = np.ones(len(points), np.int64)
    tree = cKDTree(points)
    expected = float(tree.count_neighbors(tree, eps)) / 2 if len(points) > 1000 else 0.0
    if expected > MAX_PAIRS:
        points, of, weight = _gather_in_cells(points, eps / 4)
        tree = cKDTree(points)
        expected = float(tree.count_neighbors(tree, eps)) / 2
    needed = PAIR_BYTES * expected + POINT_BYTES * len(of)
    require_memory(needed, f"{expected:,.0f} pairs of neighbours among {len(of):,} points on damage", REMEDY)
    pairs = tree.query_pairs(eps, output_type="ndarray")
    count = weight + np.bincount(pairs[:, 0], weight[pairs[:, 1]], len(points)).astype(np.int64)
    count += np.bincount(pairs[:, 1], weight[pairs[:, 0]], len(points)).astype(np.int64)
    dense = count >= neighbours
    linked = pairs[dense[pairs].all(axis=1)]
    graph = coo_array((np.ones(len(linked), bool), (linked[:, 0], linked[:, 1])), shape=(len(points), len(points)))
    _, component = connected_components(graph, directed=False)
    cluster = np.where(dense, component, -1).astype(np.int64)
    if dense.any() and not dense.all():
        cores = np.flatnonzero(dense)
        distance, nearest = map(np.asarray, cKDTree(points[cores]).query(points[~dense], distance_upper_bound=eps))
        reached = np.isfinite(distance)
        cluster[np.flatnonzero(~dense)[reached]] = cluster[cores[nearest[reached]]]
    used, compact = np.unique(cluster, return_inverse=True)
    shift = 1 if len(used) and used[0] < 0 else 0
    result: Ints = (compact.ravel() - shift)[of]
    return result


def measure_neighbour_distances(points: Floats, neighbours: int) -> Floats:
    """Mean distance (M,) of each of ``points`` (M,3) to its ``neighbours`` nearest ones; inf where there are fewer."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=neighbours + 1, workers=count_threads())
    result: Floats = np.asarray(distance)[:, 1:].mean(axis=1)
    return result


def _gather_in_cells(points: Floats, cell: float) -> tuple[Floats, Ints, Ints]:
    """Averages points in cells of a grid: the mean points, the cell of each point, the number of points of each
    cell."""
    cubes = Patches.in_cubes(points, cell)
    return cubes.mean(points), cubes.group, cubes.count
