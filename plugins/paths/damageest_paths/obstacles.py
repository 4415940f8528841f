"""What the nozzle must not touch, as points in a tree of balls, and as triangles of the FCL library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.duplicates import order_integers
from damageest.geometry.morton import encode_cells
from damageest_paths.frames import find_across
from damageest_paths.process import Pass
from damageest_paths.trees import make_tree

FINE, GROWTH = 0.4, 0.4
"""Longest edge of the obstacles' triangles, whose middles are the points: in bead widths near the deposit, and as a
share of the distance from it."""
COARSER = 2.0
"""How much farther apart the points are for layers along the floor and for travel than for layers in planes."""
MEMBERS = 8
"""Balls of one level of the tree, or points, that a ball of the next level holds."""
ROOTS = 16
"""Balls of the first level at most."""
SIDES = 6
"""Of the half circle at the end of a bead."""
BITS = 14
"""Digits of a point's place along each axis by which neighbours are found."""


@dataclass(frozen=True, eq=False)
class Level:
    """Balls: ``middle`` (3,K), ``radius`` (K,), ``top`` (K,): the largest height of what they hold, ``rank`` (K,): the
    least rank of it, and ``one`` (3,K): a point of that rank on the surface that they hold, near the middle. Places are
    columns, so that each coordinate is read in one piece."""

    middle: Floats
    radius: Floats
    top: Floats
    rank: Ints
    one: Floats


class Obstacles:
    """Meshes prepared for distances to the nozzle, in coordinates near the origin.

    ``levels``: of a tree of balls, from a few large ones to the last. The balls of the last are points of the meshes:
    each stands for the surface within its radius, and its middle lies on it. ``MEMBERS`` balls in a row are in one ball
    of the level before. ``objects``: the meshes, as FCL has them.
    """

    def __init__(
        self, meshes: Sequence[Mesh], low: Floats, high: Floats, width: float, ranks: Sequence[int] | None = None,
        coarser: float = 1.0,
    ) -> None:  # fmt: skip
        """``low``, ``high`` (3,): the box round the deposit, near which the points are dense; ``width`` of a bead;
        ``ranks``: for each mesh, ascending, the order in which it is built up; by default all are there from the
        beginning. ``coarser``: factor of the points' distance."""
        self._trees = [_Tree(mesh) for mesh in meshes]
        self.ranks: list[int] = [0] * len(meshes) if ranks is None else list(ranks)
        parts = [_cut_triangles(mesh.triangles, low, high, coarser * width) for mesh in meshes]
        triangles = np.concatenate(parts) if parts else np.empty((0, 3, 3))
        rank = np.repeat(np.array(self.ranks, np.int64), [len(part) for part in parts])
        self.levels: list[Level] = []
        if len(triangles):
            order = _fill_balls(triangles)
            triangles = triangles[order]
            self.levels = _make_levels(triangles, rank[order])
        self._corners = triangles.astype(np.float32)
        self._turn = np.eye(3)

    def find_triangles(self, ball: Ints) -> Floats:
        """The triangles (K,3,3) of the balls (K,) of the last level."""
        return self._corners[ball] @ self._turn.T

    @cached_property
    def objects(self) -> list[Any]:
        import fcl

        return [fcl.CollisionObject(one.tree, fcl.Transform(self._turn, np.zeros(3))) for one in self._trees]

    def turn(self, turn: Floats) -> Obstacles:
        """The same in other coordinates, whose axes are the rows of ``turn`` (3,3)."""
        found = Obstacles((), np.zeros(3), np.zeros(3), 1.0)
        found._trees, found.ranks, found._turn = self._trees, self.ranks, turn @ self._turn
        found._corners = self._corners
        for level in self.levels:
            middle = turn @ level.middle
            found.levels.append(Level(middle, level.radius, middle[2] + level.radius, level.rank, turn @ level.one))
        return found


def draw_beads(start: Floats, stop: Floats, normals: Floats, width: float, height: float) -> Mesh:
    """Closed prisms that hold the beads from ``start`` (N,3) to ``stop`` (N,3), both on their tops.

    ``normals`` (N,3): of the layer. The round ends have `SIDES` sides each.
    """
    along = stop - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(normals, along) / np.maximum(length, 1e-300)
    along = along / np.maximum(length, 1e-300)
    short = length[:, 0] <= 1e-12
    if short.any():
        along[short] = np.array([find_across(normal) for normal in normals[short]])
        across[short] = np.cross(normals[short], along[short])
    angle = np.pi * (np.arange(SIDES) + 0.5) / SIDES - np.pi / 2
    radius = width / 2 / np.cos(np.pi / SIDES / 2)
    ahead = radius * (np.cos(angle)[:, None] * along[:, None] + np.sin(angle)[:, None] * across[:, None])
    top = np.concatenate([stop[:, None] + ahead, start[:, None] - ahead], axis=1)
    corners = np.concatenate([top, top - height * normals[:, None]], axis=1)
    count = 2 * SIDES
    near = np.arange(count)
    after = (near + 1) % count
    fan = np.stack([np.zeros(count - 2, int), near[1:-1], near[2:]], axis=1)
    sides = np.concatenate(
        [np.stack([near + count, after + count, after], axis=1), np.stack([near + count, after, near], axis=1)]
    )
    faces = np.concatenate([fan, fan[:, ::-1] + count, sides])
    shift = 2 * count * np.arange(len(start))
    return Mesh(corners.reshape(-1, 3), (faces + shift[:, None, None]).reshape(-1, 3))


def draw_passes(passes: Sequence[Pass], width: float, height: float) -> Mesh:
    """The beads of passes, see `draw_beads`."""
    start = np.concatenate([one.points[:-1] for one in passes])
    stop = np.concatenate([one.points[1:] for one in passes])
    return draw_beads(start, stop, np.concatenate([one.normals[1:] for one in passes]), width, height)


@dataclass(frozen=True, eq=False)
class _Tree:
    """FCL's ``tree`` of a mesh, made where it is asked for: mostly the bounds decide."""

    mesh: Mesh

    @cached_property
    def tree(self) -> Any:
        return make_tree(self.mesh)


def _find_depth(count: int) -> int:
    """The number of levels above the last, of ``count`` balls."""
    depth = 0
    while count > ROOTS * MEMBERS**depth:
        depth += 1
    return depth


def _fill_balls(triangles: Floats) -> Ints:
    """An order (K,) of triangles (F,3,3) by place, the last of them again until each ball is full."""
    order = _order_by_place(triangles.mean(axis=1))
    return np.append(order, np.repeat(order[-1:], -len(order) % MEMBERS ** _find_depth(len(order))))


def _make_levels(triangles: Floats, rank: Ints) -> list[Level]:
    """The tree over triangles (F,3,3) in the order of `_fill_balls`, and their ranks (F,)."""
    points = triangles.mean(axis=1)
    radius = np.sqrt(((triangles - points[:, None]) ** 2).sum(axis=2).max(axis=1))
    rows = np.ascontiguousarray(points.T)
    levels = [Level(rows, radius, triangles[:, :, 2].max(axis=1), rank, rows)]
    for _ in range(_find_depth(len(points))):
        own, reach = levels[0].middle.reshape(3, -1, MEMBERS), levels[0].radius.reshape(-1, MEMBERS)
        middle = (own.min(axis=2) + own.max(axis=2)) / 2
        away = np.sqrt(((own - middle[..., None]) ** 2).sum(axis=0)) + reach
        ones, ranks = levels[0].one.reshape(3, -1, MEMBERS), levels[0].rank.reshape(-1, MEMBERS)
        far = ((ones - middle[..., None]) ** 2).sum(axis=0)
        best = np.where(ranks == ranks.min(axis=1)[:, None], far, np.inf).argmin(axis=1)
        top = levels[0].top.reshape(-1, MEMBERS).max(axis=1)
        one = ones[:, np.arange(len(best)), best]
        levels.insert(0, Level(middle, away.max(axis=1), top, ranks.min(axis=1), one))
    return levels


def _order_by_place(points: Floats) -> Ints:
    """An order (K,) of points (K,3) in which neighbours follow each other: along a curve of Morton."""
    low = points.min(axis=0)
    size = max(float((points.max(axis=0) - low).max()), 1e-300)
    place = ((points - low) * ((2**BITS - 1) / size)).astype(np.int64)
    return order_integers(encode_cells(place))


def _cut_triangles(triangles: Floats, low: Floats, high: Floats, width: float) -> Floats:
    """Triangles (F,3,3), halved at their longest edges until they are small enough for their distance from a box."""
    done = []
    while len(triangles):
        away = triangles.mean(axis=1)
        away = np.linalg.norm(np.maximum(np.maximum(low - away, away - high), 0), axis=1)
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        longest = sides.argmax(axis=1)
        large = sides.max(axis=1) > np.maximum(FINE * width, GROWTH * away)
        done.append(triangles[~large])
        cut = triangles[large]
        order = (longest[large, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(cut, order[..., None], axis=1), 1, 0)
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done) if done else triangles
