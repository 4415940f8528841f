"""What the nozzle must not touch, as small triangles in a tree of boxes, and as meshes of the FCL library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.vectors import measure_longest_edges, normalise
from damageest_paths.clearance.boxes import Boxes, make_boxes
from damageest_paths.process.frames import find_across
from damageest_paths.process.process import Pass
from damageest_paths.tool.trees import make_tree

FINE, GROWTH = 0.4, 0.4
"""Longest edge of the obstacles' triangles: in bead widths near the deposit, and as a share of the distance from
it."""
COARSER = 2.0
"""How much longer these edges are for layers along the floor and for travel than for layers in planes."""
SIDES = 6
"""Of the half circle at the end of a bead."""
MITRED = np.radians(45.0)
"""Turn between two beads up to which both are blocks that are longer by so much that they fill its outer side."""
BLOCK = np.array(
    [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [0, 4, 5], [0, 5, 1], [1, 5, 6], [1, 6, 2], [2, 6, 7], [2, 7, 3],
     [3, 7, 4], [3, 4, 0]]
)  # fmt: skip
"""Faces of a block with corners 0 to 3 on its top, and 4 to 7 below them."""


class Obstacles:
    """Meshes prepared for distances to the nozzle, in coordinates near the origin.

    ``boxes``: the tree over the meshes' triangles, which are cut until they are small; None without any. ``objects``:
    the meshes, as FCL has them. ``ranks``: for each mesh, ascending, the order in which it is built up.
    """

    def __init__(
        self, meshes: Sequence[Mesh], low: Floats, high: Floats, width: float, ranks: Sequence[int] | None = None,
        coarser: float = 1.0,
    ) -> None:  # fmt: skip
        """``low``, ``high`` (3,): the box round the deposit, near which the points are dense; ``width`` of a bead;
        ``ranks``: for each mesh, ascending, the order in which it is built up; by default all are there from the
        beginning. ``coarser``: factor of the triangles' edges."""
        self._trees = [_Tree(mesh) for mesh in meshes]
        self.ranks: list[int] = [0] * len(meshes) if ranks is None else list(ranks)
        parts = [_cut_triangles(mesh.triangles, low, high, coarser * width) for mesh in meshes]
        triangles = np.concatenate(parts) if parts else np.empty((0, 3, 3))
        rank = np.repeat(np.array(self.ranks, np.int64), [len(part) for part in parts])
        self.boxes: Boxes | None = make_boxes(triangles, rank) if len(triangles) else None

    @cached_property
    def objects(self) -> list[Any]:
        import fcl

        turn = np.eye(3) if self.boxes is None else self.boxes.turn
        return [fcl.CollisionObject(one.tree, fcl.Transform(turn, np.zeros(3))) for one in self._trees]

    def turn(self, turn: Floats) -> Obstacles:
        """The same in other coordinates, whose axes are the rows of ``turn`` (3,3)."""
        found = Obstacles((), np.zeros(3), np.zeros(3), 1.0)
        found._trees, found.ranks = self._trees, self.ranks
        found.boxes = None if self.boxes is None else self.boxes.turn_to(turn)
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
    """The beads of passes, as `draw_beads` has them; blocks where one goes on into the next with little of a turn."""
    start = np.concatenate([one.points[:-1] for one in passes])
    stop = np.concatenate([one.points[1:] for one in passes])
    normals = np.concatenate([one.normals[1:] for one in passes])
    length = np.linalg.norm(stop - start, axis=1)
    along = (stop - start) / np.maximum(length, 1e-300)[:, None]
    turn = np.arccos(np.clip(np.einsum("ij,ij->i", along[1:], along[:-1]), -1, 1))
    turn[np.cumsum([len(one.points) - 1 for one in passes])[:-1] - 1] = np.inf
    before, after = np.append(np.inf, turn), np.append(turn, np.inf)
    flat = (np.maximum(before, after) < MITRED) & (length > 1e-12)
    rest = draw_beads(start[~flat], stop[~flat], normals[~flat], width, height)
    reach = [width / 2 * np.tan(angle[flat] / 2)[:, None] * along[flat] for angle in (before, after)]
    blocks = _draw_blocks(start[flat] - reach[0], stop[flat] + reach[1], normals[flat], width, height)
    return Mesh(
        np.concatenate([rest.vertices, blocks.vertices]),
        np.concatenate([rest.faces, blocks.faces + len(rest.vertices)]),
    )


def _draw_blocks(start: Floats, stop: Floats, normals: Floats, width: float, height: float) -> Mesh:
    """Closed blocks from ``start`` (N,3) to ``stop`` (N,3), both in the middle of their tops."""
    across = width / 2 * normalise(np.cross(normals, stop - start), 1e-300)
    top = np.stack([start - across, stop - across, stop + across, start + across], axis=1)
    corners = np.concatenate([top, top - height * normals[:, None]], axis=1)
    return Mesh(corners.reshape(-1, 3), (BLOCK + 8 * np.arange(len(start))[:, None, None]).reshape(-1, 3))


@dataclass(frozen=True, eq=False)
class _Tree:
    """FCL's ``tree`` of a mesh, made where it is asked for: mostly the bounds decide."""

    mesh: Mesh

    @cached_property
    def tree(self) -> Any:
        return make_tree(self.mesh)


def _cut_triangles(triangles: Floats, low: Floats, high: Floats, width: float) -> Floats:
    """Triangles (F,3,3), halved at their longest edges until they are small enough for their distance from a box."""
    done = []
    while len(triangles):
        middle = (triangles[:, 0] + triangles[:, 1] + triangles[:, 2]) / 3
        away = np.linalg.norm(np.maximum(np.maximum(low - middle, middle - high), 0), axis=1)
        large = measure_longest_edges(triangles) > np.maximum(FINE * width, GROWTH * away)
        done.append(triangles[~large])
        cut = triangles[large]
        longest = np.linalg.norm(cut - np.roll(cut, -1, axis=1), axis=2).argmax(axis=1)
        order = (longest[:, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(cut, order[..., None], axis=1), 1, 0)
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done) if done else triangles
