"""Those of very many points that lie near some places, without a search tree over all of them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.lattice import CHUNK, MOST_ALONG, Lattice


def nearby(points: Floats, places: Floats, reach: float) -> Ints:
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
    lattice = Lattice(low, size, shape)
    taken = lattice.around(places, 1)
    found = []
    for start in range(0, len(points), CHUNK):
        found.append(start + np.flatnonzero(taken[lattice.cells(points[start : start + CHUNK])]))
    return np.concatenate(found)


def within(points: Floats, low: Floats, high: Floats) -> Ints:
    """Ascending indices of the points (N,3) strictly inside a box."""
    index = np.flatnonzero((points[:, 0] > low[0]) & (points[:, 0] < high[0]))
    for axis in (1, 2):
        along = points[index, axis]
        index = index[(along > low[axis]) & (along < high[axis])]
    return index
