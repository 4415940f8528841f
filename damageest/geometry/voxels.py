"""Cubes of space that points lie in, by number."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints

MOST_ALONG = 320
"""Cubes of a `Lattice` along an axis at most, for the memory's sake: 33 MB."""

CHUNK = 1 << 18
"""Points looked up in a `Lattice` at a time, so that what comes between stays in the processor's cache."""


class VoxelGrid(NamedTuple):
    """Cubes of edge ``size`` from corner ``low`` (3,), ``shape`` (3,) of them."""

    low: Floats
    size: float
    shape: Ints

    def number_cells(self, points: Floats) -> Ints:
        """The number (N,) of each point's cube; beyond the lattice, of the outermost."""
        number = np.zeros(len(points), np.int64)
        for axis in range(3):
            along = (points[:, axis] - self.low[axis]) * (1 / self.size)
            number *= self.shape[axis]
            number += np.clip(along, 0, self.shape[axis] - 1, out=along).astype(np.int64)
        return number

    def mark_around(self, points: Floats, layers: int) -> NDArray[np.bool_]:
        """(cubes,) whether a cube holds one of the points or is at most ``layers`` from one that does."""
        taken = np.zeros(int(np.prod(self.shape)), bool)
        taken[self.number_cells(points)] = True
        steps = np.array([self.shape[1] * self.shape[2], self.shape[2], 1])
        for step in steps:  # one axis after the other
            held = np.flatnonzero(taken)
            for shift in range(-layers, layers + 1):
                taken[held + shift * step] = True
        return taken


def number_cubes(points: Floats, edge: float, low: Floats | None = None) -> tuple[Ints, Ints]:
    """The cube (N,3) of an unbounded lattice from ``low`` (3,), the points' own lowest corner by default, that each of
    the points (N,3) lies in, and its number (N,): equal for points of one cube, rising along x, then y, then z."""
    cell = np.floor((points - (points.min(axis=0) if low is None else low)) / edge).astype(np.int64)
    size = cell.max(axis=0) + 1
    return cell, (cell[:, 0] * size[1] + cell[:, 1]) * size[2] + cell[:, 2]


def number_faced_cubes(points: Floats, normals: Floats, edge: float) -> tuple[Ints, Ints]:
    """As `cubes`, the number (N,) telling apart as well which of the six directions a normal (N,3) is nearest to."""
    cell, number = number_cubes(points, edge)
    axis = np.abs(normals).argmax(axis=1)
    return cell, number * 6 + 2 * axis + (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] > 0)
