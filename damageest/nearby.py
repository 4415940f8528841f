"""Those of very many points that lie near some places, without a search tree over all of them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints

MOST_ALONG = 320
"""Cubes of the lattice along an axis at most, for the memory's sake: 33 MB."""

CHUNK = 1 << 18
"""Points looked up at a time, so that what comes between stays in the processor's cache."""


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
    step = np.array([shape[1] * shape[2], shape[2], 1])
    taken = np.zeros(int(np.prod(shape)), bool)
    taken[_cubes(places, low, size, shape)] = True
    around = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3) @ step
    held = np.flatnonzero(taken)
    for shift in around:
        taken[held + shift] = True
    found = []
    for start in range(0, len(points), CHUNK):
        found.append(start + np.flatnonzero(taken[_cubes(points[start : start + CHUNK], low, size, shape)]))
    return np.concatenate(found)


def within(points: Floats, low: Floats, high: Floats) -> Ints:
    """Ascending indices of the points (N,3) strictly inside a box."""
    index = np.flatnonzero((points[:, 0] > low[0]) & (points[:, 0] < high[0]))
    for axis in (1, 2):
        along = points[index, axis]
        index = index[(along > low[axis]) & (along < high[axis])]
    return index


def _cubes(points: Floats, low: Floats, size: float, shape: Ints) -> Ints:
    """The number (N,) of each point's cube, the outermost for those beyond."""
    number = np.zeros(len(points), np.int64)
    for axis in range(3):
        along = (points[:, axis] - low[axis]) * (1 / size)
        number *= shape[axis]
        number += np.clip(along, 0, shape[axis] - 1, out=along).astype(np.int64)
    return number
