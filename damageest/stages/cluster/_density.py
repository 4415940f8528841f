"""Density clustering with bounded memory."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.voxels import number_cubes

MAX_PAIRS = 20_000_000
"""Pairs of neighbours that may be held at once, 16 bytes each; more, and points are first gathered into a grid."""


def run_dbscan(points: Floats, eps: float, neighbours: int) -> Ints:
    """Cluster number (M,) per point, -1 for noise (Ester et al. 1996); border points join their nearest dense point.

    Where points lie so close that their pairs would not fit in memory, those within one cell of a grid of eps/4 count
    as one point of their number; distances are then right within that cell's size.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    of = np.arange(len(points))
    weight = np.ones(len(points), np.int64)
    tree = cKDTree(points)
    if len(points) > 1000 and tree.count_neighbors(tree, eps) / 2 > MAX_PAIRS:
        points, of, weight = _gather_in_cells(points, eps / 4)
        tree = cKDTree(points)
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
    """Average distance (M,) of each of ``points`` (M,3) to its ``neighbours`` nearest; inf where there are fewer."""
    from scipy.spatial import cKDTree

    distance, _ = cKDTree(points).query(points, k=neighbours + 1, workers=-1)
    result: Floats = np.asarray(distance)[:, 1:].mean(axis=1)
    return result


def _gather_in_cells(points: Floats, cell: float) -> tuple[Floats, Ints, Ints]:
    """Mean points of the occupied cells of a grid, the cell of each point, and the number of points in each cell."""
    _, of, count = np.unique(number_cubes(points, cell)[1], return_inverse=True, return_counts=True)
    of = of.ravel()
    means = np.stack([np.bincount(of, points[:, axis]) for axis in range(3)], axis=1) / count[:, None]
    return means, of, count
