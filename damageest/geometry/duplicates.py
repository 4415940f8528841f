"""Values and points that are exactly equal.

`numpy.unique` and `numpy.isin` hash numbers: where most of a million differ, that takes ten times as long as to sort
them (numpy 2.4). So large arrays of numbers go through the functions here.
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np

from damageest.artefacts import Flags, Floats, Ints

N = TypeVar("N", bound=np.integer[Any])


def list_distinct(values: np.ndarray[Any, np.dtype[N]]) -> np.ndarray[tuple[int], np.dtype[N]]:
    """The distinct ones of any number of integers, ascending."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), bool)
    first[1:] = ordered[1:] != ordered[:-1]
    return ordered[first]


def order_integers(values: Ints) -> Ints:
    """The order (N,) that sorts integers; equal ones stay in their order."""
    if not len(values):
        return np.empty(0, np.int64)
    low, count = int(values.min()), len(values)
    if (int(values.max()) - low + 1) * count >= 2**62:
        return np.argsort(values, kind="stable")
    # each together with its place, which is much faster to sort than places by values
    return np.sort((values - low) * count + np.arange(count)) % count


def group_integers(values: Ints) -> tuple[Ints, Ints, Ints]:
    """Groups of equal integers, ascending: the index (G,) of the first of each, the group (N,) of each integer, and how
    many each group has (G,)."""
    order = order_integers(values)
    ordered = values[order]
    begins = np.ones(len(order), bool)
    begins[1:] = ordered[1:] != ordered[:-1]
    start = np.flatnonzero(begins)
    group = np.empty(len(order), np.int64)
    group[order] = np.cumsum(begins) - 1
    return order[start], group, np.diff(start, append=len(order))


def find_members(values: Ints, others: Ints) -> Flags:
    """Whether each of the integers ``values`` (N,) is one of the ``others`` (M,)."""
    if not len(others):
        return np.zeros(len(values), bool)
    ordered = np.sort(others)
    return np.asarray(ordered[np.minimum(np.searchsorted(ordered, values), len(ordered) - 1)] == values)


def list_used(faces: Ints) -> Ints:
    """The vertices that faces (F,3) use, ascending."""
    return np.flatnonzero(np.bincount(faces.ravel()))


def find_duplicates(points: Floats) -> tuple[Ints, Ints]:
    """Which of the points (N,3) are exactly equal: ``keep`` (M,) and ``inverse`` (N,).

    ``keep`` holds, ascending, the index of the first copy of each distinct point. ``inverse`` tells which of them each
    point equals, so that ``points[keep][inverse]`` equals ``points``. 0 and -0 are equal.

    Sorts one 64-bit hash per point, which is much faster than sorting rows. Points with equal hashes are compared in
    full.
    """
    points = np.asarray(points, dtype=np.float64)
    mixed = np.zeros(len(points), np.uint64)
    with np.errstate(over="ignore"):
        for place, odd in zip(points.T, (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9), strict=True):
            column = (place + 0.0).view(np.uint64)  # + 0.0 turns -0 into 0; one column a time, to save memory
            mixed ^= column
            column >>= np.uint64(29)
            mixed ^= column
            mixed *= np.uint64(odd)
            mixed ^= mixed >> np.uint64(32)
    ordered = np.sort(mixed)
    if not (ordered[1:] == ordered[:-1]).any():
        every = np.arange(len(points))
        return every, every
    del ordered
    bits = (np.ascontiguousarray(points) + 0.0).view(np.uint64)
    order = np.argsort(mixed, kind="stable")
    same = (mixed[order][1:] == mixed[order][:-1]) & (bits[order][1:] == bits[order][:-1]).all(1)
    # copies of two distinct points with equal hashes may alternate in the order: then the rows themselves are sorted
    clash = (mixed[order][1:] == mixed[order][:-1]) & ~same
    if clash.any():
        _, first, inverse = np.unique(bits, axis=0, return_index=True, return_inverse=True)
        rank = np.argsort(np.argsort(first))
        return np.sort(first), rank[inverse.reshape(-1)]
    group = np.concatenate([[0], np.cumsum(~same)])
    first = order[np.concatenate([[True], ~same])]
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    inverse = np.empty(len(points), np.int64)
    inverse[order] = rank[group]
    return np.sort(first), inverse
