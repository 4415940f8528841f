"""The tops of conformal layers: surfaces at equal depth above the cavity floor, over a grid of columns."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.distance import SurfaceTree, distance_to_edges, signed_distance
from damageest.geometry.vectors import normalise
from damageest_paths.process.process import Process
from damageest_paths.sheets.floor import Floor

FINE = 0.25
"""Distance of the grid's columns on the steepest place of the floor, in bead widths."""
COARSE = 0.2
"""Distance of those columns, in bead widths, that the nozzle is kept clear of."""
MOST_COLUMNS = 20_000
STEPS = 30
"""Steps by which a column is brought to a depth at most."""
CLOSE = 1e-4
"""Share of the layer height to which it is brought. Places of passes are brought nearer, see `SheetTree.find`."""
CYCLE = 1e-9
"""Share of the layer height within which a column is where it was two steps before."""
SAMPLES = (0, 8, 2, 6, 1, 3, 5, 7)
"""Eighths of a layer's height below its top at which it is looked for the deposit, but for the middle; in this order,
so that what is known of some tells most of the others."""
UNDER = 0.25
"""Share of the layer height by which metal may lie deeper than the layer's bottom and still hold it."""
NEAR = 0.5
"""Share of an edge of a sheet's triangles by which a place between its points is moved at most to have its depth."""
STEEP = 0.15
"""Cosine of the steepest angle at which a column is followed."""


class Grid(NamedTuple):
    """Columns (N,2), at a distance of ``edge``, with a triangle (F,3) between each three neighbours, and the number of
    rows and columns. ``coarse`` (G,3): the same with larger triangles. ``near`` (K,): the numbers of the columns that
    are near enough to the deposit for what is drawn on a layer."""

    columns: Floats
    edge: float
    faces: Ints
    coarse: Ints
    shape: tuple[int, int]
    near: Ints


@dataclass(frozen=True, eq=False)
class Sheet:
    """The top of a layer at a ``depth``: ``points`` (N,3), one in each column; ``upward`` (N,3): where the depth grows;
    ``normals`` (N,3): the same, smoothed over a bead; ``is_found`` (N,): whether the column has that depth."""

    depth: float
    points: Floats
    upward: Floats
    normals: Floats
    is_found: Flags


def make_grid(floor: Floor, places: Floats, process: Process) -> Grid:
    """Columns over the box round a deposit, denser the steeper the floor is. ``places`` (K,3): on the deposit, no
    farther from each other than a bead's width."""
    from scipy.spatial import cKDTree

    width = process.bead.width
    slope = np.sort(np.abs(floor.mesh.face_normals[:, 2]))
    steep = max(float(slope[len(slope) // 20]), 0.5)
    edge = FINE * width * steep
    margin = width + max(process.extend) + 2 * edge
    low, high = places[:, :2].min(axis=0) - margin, places[:, :2].max(axis=0) + margin
    edge *= max(1.0, float(np.sqrt(np.prod((high - low) / edge) / MOST_COLUMNS)))
    x, y = (np.arange(low[k], high[k] + edge, edge) for k in range(2))
    columns = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    number = np.arange(len(columns)).reshape(len(x), len(y))
    stride = max(1, int(COARSE * width / edge))
    rows, lines = (np.unique(np.append(np.arange(0, many, stride), many - 1)) for many in number.shape)
    away = cKDTree(places[:, :2]).query(columns, distance_upper_bound=margin + width)[0]
    near = np.flatnonzero(np.isfinite(away))
    return Grid(columns, edge, _span(number), _span(number[np.ix_(rows, lines)]), number.shape, near)


def _span(number: Ints) -> Ints:
    """Triangles (F,3) between columns with the numbers (R,C)."""
    a, b, c, d = number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def guess_heights(floor: Floor, grid: Grid) -> Floats:
    """Heights (N,) at which the columns meet about the floor, or the planes beyond its rim."""
    from scipy.spatial import cKDTree

    vertices, normals = floor.mesh.vertices, floor.normals
    nearest = cKDTree(vertices[:, :2]).query(grid.columns)[1]
    away = grid.columns - vertices[nearest, :2]
    return np.asarray(
        vertices[nearest, 2]
        - np.einsum("ni,ni->n", away, normals[nearest, :2]) / np.maximum(normals[nearest, 2], STEEP)
    )


def lay_ground(floor: Floor, grid: Grid) -> Sheet:
    """The sheet from which the first layer is laid: its points are near the floor, and not at one depth."""
    points = np.column_stack([grid.columns, guess_heights(floor, grid)])
    upward, is_found = np.tile([0.0, 0.0, 1.0], (len(points), 1)), np.zeros(len(points), bool)
    return Sheet(0.0, points, upward, upward, is_found)


def lay_sheet(floor: Floor, grid: Grid, below: Sheet, depth: float, process: Process, spacing: float) -> Sheet:
    """The sheet at a depth, found from that ``below`` it. ``spacing``: the layer height."""
    points, upward, off = below.points.copy(), below.upward.copy(), np.full(len(below.points), np.inf)
    off[below.is_found] = depth - below.depth
    far = grid.near[~below.is_found[grid.near]]
    distance, upward[far] = floor.measure(points[far])
    off[far] = depth - distance
    far, before = grid.near, np.full((2, len(points)), np.inf)
    for number in range(STEPS):
        # a column that goes to and fro would do so to the end, where it is as it is after an even number of steps
        stays = np.abs(points[far, 2] - before[number % 2, far]) < CYCLE * spacing
        far = far[(np.abs(off[far]) > CLOSE * spacing) & ~(stays & (number % 2 == STEPS % 2))]
        if not len(far):
            break
        before[number % 2, far] = points[far, 2]
        step = off[far] / np.maximum(upward[far, 2], STEEP)
        points[far, 2] += np.clip(step, -spacing, spacing)
        distance, upward[far] = floor.measure(points[far])
        off[far] = depth - distance
    is_found = (np.abs(off) < 0.02 * spacing) & (upward[:, 2] > STEEP)
    rounds = int(np.clip(np.ceil((1.5 * process.bead.width / grid.edge) ** 2), 1, 300))
    return Sheet(depth, points, upward, _smooth(upward, is_found, grid.shape, rounds), is_found)


def _smooth(normals: Floats, is_found: Flags, shape: tuple[int, int], rounds: int) -> Floats:
    """Normals (N,3), each the mean of its neighbours', again and again."""
    field = np.where(is_found[:, None], normals, 0.0).reshape(*shape, 3)
    weight = is_found.reshape(*shape, 1).astype(float)
    for _ in range(rounds):
        padded = np.pad(field, ((1, 1), (1, 1), (0, 0)))
        total = padded[1:-1, 1:-1] * 4 + padded[2:, 1:-1] + padded[:-2, 1:-1] + padded[1:-1, 2:] + padded[1:-1, :-2]
        field = weight * total / np.maximum(np.linalg.norm(total, axis=2, keepdims=True), 1e-12)
    found = field.reshape(-1, 3)
    return np.where(is_found[:, None], found, normals)


def measure_reach(sheet: Sheet, solid: Mesh, drop: float, spacing: float) -> Floats:
    """How far (N,) the deposit is from what lies up to ``drop`` below each point of a sheet; negative where it is so.

    It is exact where it is less than ``spacing``, the distance of neighbouring points, from 0; inf where the column has
    no such depth.
    """
    found = np.full(len(sheet.points), np.inf)
    some = np.flatnonzero(sheet.is_found)
    found[some] = signed_distance(sheet.points[some] - drop / 2 * sheet.upward[some], solid)[0]
    near = some[(found[some] < drop / 2 + spacing) & (found[some] > -spacing)]
    shares = np.arange(9) / 8
    # a distance changes by no more than the way between two places, so few of them have to be looked at
    least = found[near, None] - np.abs(shares - 0.5) * drop
    for share in SAMPLES:
        own = np.flatnonzero((least[:, share] < np.minimum(found[near], spacing)) & (found[near] > -spacing))
        below = sheet.points[near[own]] - shares[share] * drop * sheet.upward[near[own]]
        distance = signed_distance(below, solid)[0]
        found[near[own]] = np.minimum(found[near[own]], distance)
        least[own] = np.maximum(least[own], distance[:, None] - np.abs(shares - shares[share]) * drop)
    return found


def measure_support(
    sheet: Sheet, some: Ints, metal: Mesh, lines: list[Floats], bead: float, drop: float, enough: float
) -> Floats:
    """How far (N,) places of a sheet, with the numbers ``some``, are from those that metal or a bead of the layer below
    holds; inf elsewhere.

    ``lines``: the passes (K,3) of the layer below; ``bead``: half of its width; ``drop``: the layer height. Values
    below ``enough`` may be too large.
    """
    held = np.full(len(sheet.points), np.inf)
    if lines and len(some):
        starts = np.concatenate([[0], np.cumsum([len(line) for line in lines])])
        edges = [np.stack([np.arange(a, b - 1), np.arange(a + 1, b)], axis=1) for a, b in pairwise(starts)]
        below = sheet.points[some] - drop * sheet.upward[some]
        held[some] = distance_to_edges(below, np.concatenate(lines), np.concatenate(edges)) - bead
    for share in (1 + UNDER, 1.0, 0.5, 0.0):
        left = some[held[some] > enough]
        if len(left) and len(metal.faces):
            below = sheet.points[left] - share * drop * sheet.upward[left]
            held[left] = np.minimum(held[left], signed_distance(below, metal)[0])
    return held


class SheetTree:
    """Finds places on a piece of a sheet by their places in the plane into which it is unrolled."""

    def __init__(self, sheet: Sheet, floor: Floor, places: Floats, faces: Ints, numbers: Ints) -> None:
        """``places`` (V,2), ``faces`` (F,3) of the piece; ``numbers`` (V,): of the sheet's points."""
        self.sheet, self.floor = sheet, floor
        self.points, self.normals = sheet.points[numbers], sheet.normals[numbers]
        self.upward = sheet.upward[numbers]
        self.tree = SurfaceTree(Mesh(np.column_stack([places, np.zeros(len(places))]), faces))
        sides = places[faces[:, 1]] - places[faces[:, 0]]
        self.farthest = NEAR * float(np.linalg.norm(sides, axis=1).mean())

    def find(self, places: Floats, exact: bool = True) -> tuple[Floats, Floats, Floats]:
        """Points (N,3) at places (N,2) of the plane, their smoothed normals (N,3), and where the depth grows (N,3).

        ``exact``: whether the points have the sheet's depth, or are only on the triangles between its points; so they
        are where that is far from the sheet's depth, as over a place at which two sides of the floor are as near.
        """
        from damageest_paths.sheets.floor import find_shares

        _, face, foot = self.tree.closest(np.column_stack([places, np.zeros(len(places))]))
        corners = self.tree.mesh.faces[face]
        share = find_shares(self.tree.mesh.triangles[face], foot)
        points = np.einsum("nk,nki->ni", share, self.points[corners])
        normals = np.einsum("nk,nki->ni", share, self.normals[corners])
        upward = np.einsum("nk,nki->ni", share, self.upward[corners])
        normals = normalise(normals)
        upward = normalise(upward)
        if exact:
            distance, upward = self.floor.measure(points)
            off = self.sheet.depth - distance
            points = points + np.where(np.abs(off) <= self.farthest, off, 0.0)[:, None] * upward
        return points, normals, upward
