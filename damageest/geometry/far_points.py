"""Points so far from all others that they cannot lie on the part."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.voxels import measure_bounds

FEWEST = 0.01
"""Share of the points of the largest group below which a group is set aside."""
MOST = 0.05
"""Largest share of all points that is set aside; above it, they are not taken for strays."""


def find_far(points: Floats, size: float) -> Flags:
    """Whether each of the points (N,3) is in a small group that lies at least ``size``, the diagonal of the part, from
    all other points.

    Points are grouped by cubes with edges of ``size``: cubes that touch belong together. A part fits into two cubes in
    each direction, so that points of it are in one group, whatever its pose.
    """
    none = np.zeros(len(points), bool)
    if not len(points) or np.ptp(measure_bounds(points), axis=0).max() <= 2 * size:
        return none
    cube = np.floor((points - np.median(points, axis=0)) / size)
    cube = np.clip(cube, -(2.0**20), 2.0**20 - 1).astype(np.int64) + 2**20
    codes, inverse, counts = np.unique(cube @ [1, 2**21, 2**42], return_inverse=True, return_counts=True)
    places = np.column_stack([codes % 2**21, codes // 2**21 % 2**21, codes // 2**42])
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(places).query_pairs(1.0, p=np.inf, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs), bool), pairs.T), shape=(len(codes),) * 2)
    group = connected_components(graph, directed=False)[1]
    total = np.bincount(group, counts)
    far: Flags = (total < FEWEST * total.max())[group][inverse.reshape(-1)]
    return far if far.mean() <= MOST else none
