"""A tree of boxes over the triangles of obstacles, in which distances to the nozzle are found."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Floats, Ints, Singles
from damageest.geometry.duplicates import order_integers
from damageest.geometry.morton import encode_cells

MEMBERS = 8
"""Boxes of the next level, or triangles, that a box holds."""
ROOTS = 16
"""Boxes of the first level at most."""
BITS = 14
"""Digits of a point's place along each axis by which neighbours are found."""

Tree = tuple[Floats, Floats, Floats, Floats, Floats, Ints, Ints, Ints, Singles, Floats]
"""See `Boxes.tree`."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """The boxes of all levels, from a few large ones to those round one triangle each, in the coordinates of the
    triangles; heights are those after a turn.

    ``middle``, ``half`` (K,3): its middle, in the last level that of the triangle, and how far it goes from there along
    each axis; ``radius`` (K,): from the middle to a corner; ``top``, ``height`` (K,): the largest height of what it
    holds, or more, and that of the middle; ``rank`` (K,): the least rank of what it holds; ``first`` (K,): the first of
    the `MEMBERS` boxes in a row that it holds, -1 in the last level; ``roots``: how many boxes the first level has;
    ``corners`` (T,3,3): the triangles of the last T boxes; ``turn`` (3,3): its rows are the axes of the coordinates in
    which poses are given.
    """

    middle: Floats
    half: Floats
    radius: Floats
    top: Floats
    height: Floats
    rank: Ints
    first: Ints
    roots: int
    corners: Singles
    turn: Floats

    @property
    def tree(self) -> Tree:
        """All as plain arrays, and how many boxes the first level has and each box holds, for `loops`."""
        sizes = np.array([self.roots, MEMBERS])
        return (
            self.middle, self.half, self.radius, self.top, self.height, self.rank, self.first, sizes, self.corners,
            self.turn,
        )  # fmt: skip

    def turn_to(self, turn: Floats) -> Boxes:
        """The same for poses in other coordinates, whose axes are the rows of ``turn`` (3,3)."""
        turn = np.ascontiguousarray(turn @ self.turn)
        height = self.middle @ turn[2]
        return replace(self, turn=turn, height=height, top=height + self.half @ np.abs(turn[2]))


def make_boxes(triangles: Floats, rank: Ints) -> Boxes:
    """The tree over triangles (F,3,3), at least one, of ranks (F,)."""
    order = _fill(triangles)
    corners, rank = triangles[order].astype(np.float32), rank[order]
    a, b, c = (corners[:, k].astype(float) for k in range(3))  # one by one: along a short axis numpy takes far longer
    middle = (a + b + c) / 3
    half = np.maximum(np.maximum(np.abs(a - middle), np.abs(b - middle)), np.abs(c - middle))
    levels = [(middle, half, rank)]
    for _ in range(_find_depth(len(middle))):
        levels.insert(0, _hold(*levels[0]))
    counts = np.array([len(level[0]) for level in levels])
    inner = int(counts[:-1].sum())
    first = np.full(counts.sum(), -1, np.int64)
    first[:inner] = counts[0] + MEMBERS * np.arange(inner)
    middle, half, rank = (np.concatenate(columns) for columns in zip(*levels, strict=True))
    radius, height = np.linalg.norm(half, axis=1), middle[:, 2].copy()
    top = height + half[:, 2]
    return Boxes(middle, half, radius, top, height, rank, first, int(counts[0]), corners, np.eye(3))


def _hold(middle: Floats, half: Floats, rank: Ints) -> tuple[Floats, Floats, Ints]:
    """The boxes of the level before, each of which holds `MEMBERS` of these boxes in a row."""
    low, high = ((middle + side * half).reshape(-1, MEMBERS, 3) for side in (-1, 1))
    low, high = low.min(axis=1), high.max(axis=1)
    return (low + high) / 2, (high - low) / 2, rank.reshape(-1, MEMBERS).min(axis=1)


def _find_depth(count: int) -> int:
    """The number of levels above the last, of ``count`` boxes."""
    depth = 0
    while count > ROOTS * MEMBERS**depth:
        depth += 1
    return depth


def _fill(triangles: Floats) -> Ints:
    """An order (K,) of triangles (F,3,3) by place, the last of them again until each box is full."""
    order = _order_by_place(triangles.mean(axis=1))
    return np.append(order, np.repeat(order[-1:], -len(order) % MEMBERS ** _find_depth(len(order))))


def _order_by_place(points: Floats) -> Ints:
    """An order (K,) of points (K,3) in which neighbours follow each other: along a curve of Morton."""
    low = points.min(axis=0)
    size = max(float((points.max(axis=0) - low).max()), 1e-300)
    place = ((points - low) * ((2**BITS - 1) / size)).astype(np.int64)
    return order_integers(encode_cells(place))
