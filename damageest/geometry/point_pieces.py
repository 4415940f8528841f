"""Connected pieces of a point cloud."""

from __future__ import annotations

import itertools

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import order_integers
from damageest.geometry.voxels import number_cubes


def number_pieces(points: Floats, gap: float) -> Ints:
    """The number (N,) of the connected piece that each of the points (N,3) belongs to, from 0.

    Two points are connected where their distance is at most ``gap``, directly or over other points. The points are
    sorted into cubes whose diagonal is the gap, so that all points of a cube are connected. Cubes near each other are
    connected by one pair of their points, or else compared in full. Pieces are numbered in the order of their first
    cubes.
    """
    from scipy.cluster.hierarchy import DisjointSet
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial.distance import cdist

    if not len(points):
        return np.empty(0, np.int64)
    cell, number = number_cubes(points, gap / np.sqrt(3) * (1 - 1e-9))
    order = order_integers(number)
    cubes, first, cube = np.unique(number[order], return_index=True, return_inverse=True)
    ends = np.append(first[1:], len(order))
    place = cell[order[first]]
    # with a border of 2, the number of a neighbouring cube is a constant away
    size = cell.max(axis=0) + 5
    key = ((place[:, 0] + 2) * size[1] + place[:, 1] + 2) * size[2] + place[:, 2] + 2
    pairs: list[Ints] = []
    for step in itertools.product(range(3), range(-2, 3), range(-2, 3)):
        apart = np.maximum(np.abs(step) - 1, 0)
        if step <= (0, 0, 0) or (apart**2).sum() > 3:
            continue
        wanted = key + (step[0] * size[1] + step[1]) * size[2] + step[2]
        at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
        here = np.flatnonzero(key[at] == wanted)
        pairs.append(np.column_stack([here, at[here]]))
    pair = np.concatenate(pairs) if pairs else np.empty((0, 2), np.int64)
    middle = points[order[(first + ends) // 2]]
    near = np.linalg.norm(middle[pair[:, 0]] - middle[pair[:, 1]], axis=1) <= gap

    def connect(joined: Ints) -> Ints:
        graph = coo_array((np.ones(len(joined)), (joined[:, 0], joined[:, 1])), (len(cubes), len(cubes)))
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

    joined = pair[near]
    label = connect(joined)
    sets = DisjointSet(range(int(label.max()) + 1))
    more = [np.empty((0, 2), np.int64)]
    for a, b in pair[label[pair[:, 0]] != label[pair[:, 1]]]:
        one, other = int(label[a]), int(label[b])
        if sets.connected(one, other):
            continue
        own, beside = points[order[first[a] : ends[a]]], points[order[first[b] : ends[b]]]
        # in chunks, as a coarse gap may put many points into one cube
        if any(cdist(own[k : k + 500], beside).min() <= gap for k in range(0, len(own), 500)):
            sets.merge(one, other)
            more.append(np.array([[a, b]]))
    piece = connect(np.concatenate([joined, *more]))
    result = np.empty(len(points), np.int64)
    result[order] = piece[cube]
    return result
