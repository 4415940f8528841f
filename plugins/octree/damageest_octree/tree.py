"""A linear octree: the nodes of a cube as sorted Morton codes; and the cells that a surface touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import list_distinct
from damageest.geometry.morton import SPREAD, encode_cells

Codes = NDArray[np.uint64]

CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.int64)
CHUNK = 20_000
"""Triangles tested at a time; they take about 60 MiB."""


def encode(cells: Ints) -> Codes:
    """Morton codes (N,) of cells (N,3), whose coordinates have at most 21 bits."""
    return encode_cells(cells).view(np.uint64)


def decode(codes: Codes) -> Ints:
    """The cells (N,3) of Morton codes (N,)."""
    masks = [0x1FFFFF, *(mask for _, mask in SPREAD)]
    cells = np.empty((len(codes), 3), np.int64)
    for axis in range(3):
        x = (codes >> np.uint64(axis)) & np.uint64(SPREAD[-1][1])
        for (shift, _), mask in zip(SPREAD[::-1], masks[-2::-1], strict=True):
            x = (x | (x >> np.uint64(shift))) & np.uint64(mask)
        cells[:, axis] = x
    return cells


@dataclass(frozen=True, eq=False)
class Tree:
    """A partition of a cube of ``2**depth`` cells a side: ``start`` (N,) the code of each node's lowest cell, sorted,
    ``low`` (N,3) that cell, ``size`` (N,) the node's edge in cells."""

    depth: int
    start: Codes
    low: Ints
    size: Ints

    def locate(self, cells: Ints) -> Ints:
        """The node (N,) that contains each of the cells (N,3); a cell outside the cube counts as the nearest inside."""
        code = encode(np.clip(cells, 0, (1 << self.depth) - 1))
        return np.searchsorted(self.start, code, side="right") - 1

    def pair_neighbours(self) -> Ints:
        """(M,2) pairs of nodes that share a face, each pair at least once."""
        nodes = np.arange(len(self.start))
        pairs = []
        for axis in range(3):
            # The smaller node of a pair always finds the larger one.
            for step in (np.full(len(nodes), -1), self.size):
                beside = self.low.copy()
                beside[:, axis] += step
                inside = (beside[:, axis] >= 0) & (beside[:, axis] < 1 << self.depth)
                pairs.append(np.stack([nodes[inside], self.locate(beside[inside])], axis=1))
        return np.concatenate(pairs)


def build_tree(leaves: Codes, depth: int) -> Tree:
    """The octree whose finest nodes are the leaves (N,) and their siblings; coarser nodes fill the rest of the cube."""
    current = list_distinct(leaves)
    starts, sizes = [current], [np.ones(len(current), np.int64)]
    for level in range(depth):
        parents = list_distinct(current >> np.uint64(3))
        children = ((parents << np.uint64(3))[:, None] | np.arange(8, dtype=np.uint64)).ravel()
        empty = children[~np.isin(children, current, assume_unique=True)]
        starts.append(empty << np.uint64(3 * level))
        sizes.append(np.full(len(empty), 1 << level))
        current = parents
    start, size = np.concatenate(starts), np.concatenate(sizes)
    order = np.argsort(start)
    return Tree(depth, start[order], decode(start[order]), size[order])


def dilate(cells: Ints, reach: int) -> Ints:
    """The cells (N,3) and all within ``reach`` of them along each axis."""
    for axis in range(3):
        steps = np.zeros((2 * reach + 1, 3), np.int64)
        steps[:, axis] = np.arange(-reach, reach + 1)
        cells = np.maximum((cells[:, None] + steps).reshape(-1, 3), 0)
        cells = decode(list_distinct(encode(cells)))
    return cells


def find_touched_cells(triangles: Floats, depth: int) -> Ints:
    """The cells (N,3) that triangles (F,3,3) touch; the triangles are given in units of cells.

    Descends level by level, with the separating-axis test of a triangle and a box (Akenine-Moller 2001).
    """
    which, low = np.arange(len(triangles)), np.zeros((len(triangles), 3), np.int64)
    for level in range(depth, 0, -1):
        half = 0.5 * (1 << (level - 1))
        pieces = []
        for begin in range(0, len(which), CHUNK):
            mine = np.repeat(which[begin : begin + CHUNK], 8)
            cells = (2 * low[begin : begin + CHUNK, None] + CORNERS).reshape(-1, 3)
            centres = np.asarray((cells + 0.5) * (2 * half), np.float64)
            is_hit = _intersects(triangles[mine], centres, half * (1 + 1e-9))
            pieces.append((mine[is_hit], cells[is_hit]))
        which = np.concatenate([piece[0] for piece in pieces])
        low = np.concatenate([piece[1] for piece in pieces])
    return decode(list_distinct(encode(low)))


def _intersects(triangles: Floats, centres: Floats, half: float) -> NDArray[np.bool_]:
    """(N,) whether each triangle (N,3,3) intersects its cube, of edge 2 ``half`` about ``centres`` (N,3)."""
    corners = triangles - centres[:, None]
    out = (corners.min(axis=1) <= half).all(axis=1) & (corners.max(axis=1) >= -half).all(axis=1)
    near = np.flatnonzero(out)
    corners = corners[near]
    edges = np.roll(corners, -1, axis=1) - corners
    axes = [np.cross(edges[:, 0], edges[:, 1])]
    axes += [np.cross(edges[:, k], np.eye(3)[axis]) for k in range(3) for axis in range(3)]
    hit = np.ones(len(near), bool)
    for axis in axes:
        along = np.einsum("nij,nj->ni", corners, axis)
        reach = half * np.abs(axis).sum(axis=1) + 1e-12
        hit &= (along.min(axis=1) <= reach) & (along.max(axis=1) >= -reach)
    out[near] = hit
    return np.asarray(out)
