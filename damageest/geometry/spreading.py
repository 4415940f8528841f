"""Spreads points over triangles, and thins them.

Triangles, points and lengths are in one unit and one frame.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.duplicates import group_integers
from damageest.geometry.threads import count_threads
from damageest.geometry.vectors import measure_longest_edges
from damageest.geometry.voxels import measure_bounds, number_cubes
from damageest.isolation.memory import require_memory

SPREAD_BYTES, THIN_BYTES, TRIANGLE_BYTES = 170, 130, 260
"""Memory to spread a point, to choose from it, and for each triangle, measured."""
MANY = 300_000
"""Points from which on fewer of them are compared in pairs at first; those that are then too far from all are next."""
FINE = 0.5
"""Step of the first points on triangles that are too small for a grid of their own, in spacings."""


def spread_on_faces(mesh: Mesh, spacing: float) -> tuple[Floats, Ints]:
    """Points (N,3) on all faces of a mesh, and the face (N,) of each; every place is within ``spacing`` of one.

    A face without area has none: it has no normal, and the points of its neighbours cover it. The same mesh gives the
    same points.
    """
    if not len(mesh.faces):
        return np.empty((0, 3)), np.empty(0, np.int64)
    triangles = mesh.triangles
    double_area = 2 * mesh.face_areas
    longest = measure_longest_edges(triangles)
    usable = double_area > 1e-12 * mesh.diagonal * longest
    # One grid per triangle wastes points on small or thin triangles: these share one thinned set of points.
    large = usable & (double_area > 0.5 * spacing * longest) & (longest > spacing)
    points, face = spread_points(triangles, np.flatnonzero(large), spacing)
    fine, fine_face = spread_points(triangles, np.flatnonzero(usable & ~large), FINE * spacing)
    kept = thin(fine, 0.5 * spacing, (1 - FINE) * spacing)
    return np.concatenate([points, fine[kept]]), np.concatenate([face, fine_face[kept]])


def spread_points(triangles: Floats, chosen: Ints, step: float) -> tuple[Floats, Ints]:
    """Points (N,3) on the ``chosen`` (K,) of ``triangles`` (F,3,3), and the triangle (N,) of each; gaps up to ``step``.

    Each triangle is divided into bands parallel to its longest edge, and the bands into columns. Each column has one
    point, in the middle of the part of it that lies in the triangle, so that narrow corners are covered too.
    """
    if not len(chosen):
        return np.empty((0, 3)), np.empty(0, np.int64)
    corners = triangles[chosen]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    first = lengths.argmax(axis=1)
    order = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(corners, order[:, :, None], axis=1), 1, 0)
    base = lengths.max(axis=1)
    along = (b - a) / base[:, None]
    apex = np.einsum("ij,ij->i", c - a, along)
    up = c - a - apex[:, None] * along
    height = np.linalg.norm(up, axis=1)
    up /= np.maximum(height, np.finfo(float).tiny)[:, None]

    bands = np.maximum(np.ceil(height / (0.8 * step)).astype(np.int64), 1)
    of = np.repeat(np.arange(len(chosen)), bands)
    band = np.arange(len(of)) - np.repeat(np.cumsum(bands) - bands, bands)
    low = band / bands[of] * height[of]
    high = (band + 1) / bands[of] * height[of]
    start = low / height[of] * apex[of]
    width = base[of] * (1 - low / height[of])
    columns = np.maximum(np.ceil(width / step).astype(np.int64), 1)
    count = int(columns.sum())
    _require_memory(SPREAD_BYTES * count + TRIANGLE_BYTES * len(chosen), count)
    row = np.repeat(np.arange(len(of)), columns)
    column = np.arange(len(row)) - np.repeat(np.cumsum(columns) - columns, columns)
    of, low, high = of[row], low[row], high[row]
    x = start[row] + (column + 0.5) / columns[row] * width[row]
    # In a band of one column the point is below the apex, where the triangle is highest.
    x = np.where(columns[row] == 1, np.clip(apex[of], start[row], start[row] + width[row]), x)
    left, right = apex[of], base[of] - apex[of]
    with np.errstate(divide="ignore", invalid="ignore"):
        roof = height[of] * np.minimum(
            np.where(left > 0, x / left, np.inf), np.where(right > 0, (base[of] - x) / right, np.inf)
        )
    y = (low + np.clip(np.minimum(high, roof), low, None)) / 2
    return a[of] + x[:, None] * along[of] + y[:, None] * up[of], chosen[of]


def thin(points: Floats, apart: float, reach: float) -> Ints:
    """Sorted indices of a subset of ``points`` (N,3), about ``apart`` from each other.

    Each point is within ``reach`` >= ``apart`` of a point of the subset. The same points give the same subset.
    """
    from scipy.spatial import cKDTree

    if not len(points):
        return np.empty(0, np.int64)
    _require_memory(THIN_BYTES * len(points), len(points))
    # First keep few points per disc: on very fine meshes the pairs of points would not fit in memory.
    todo = _pick_one_per_cell(points, (0.4 if len(points) < MANY else 0.8) * apart)
    kept, rest = np.empty(0, np.int64), np.ones(len(points), bool)
    while len(todo):
        kept = np.concatenate([kept, todo[_pick_apart(points[todo], apart)]])
        rest[todo] = False  # each of them is within ``apart`` of one that was kept
        asked = np.flatnonzero(rest)
        if len(asked):
            tree = cKDTree(points[kept])
            rest[asked] = tree.query(points[asked], distance_upper_bound=reach, workers=count_threads())[0] > reach
        todo = _pick_one_per_cell(points, 0.2 * apart, np.flatnonzero(rest))
    return np.sort(kept)


def _require_memory(needed: float, count: int) -> None:
    remedy = "a larger sample.spacing, a smaller sample.max_points, a larger tolerance, or more memory (--memory)"
    require_memory(needed, f"{count:,} points on the part, of which samples are chosen", remedy)


def _pick_one_per_cell(points: Floats, cell: float, among: Ints | None = None) -> Ints:
    """Sorted indices of one point for each occupied cell of a grid, of the points ``among`` (all by default)."""
    among = np.arange(len(points)) if among is None else among
    if not len(among):
        return among
    first = group_integers(number_cubes(points[among], cell, measure_bounds(points)[0])[1])[0]
    return among[np.sort(first)]


def _pick_apart(points: Floats, distance: float) -> Ints:
    """Indices of a maximal set of points, no two closer than ``distance``, by rounds: points whose random rank is lower
    than that of all neighbours are chosen, and their neighbours removed (Luby 1986)."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    rank = np.random.default_rng(0).permutation(len(points))
    chosen = np.zeros(len(points), bool)
    undecided = np.ones(len(points), bool)
    while undecided.any():
        lowest = rank.copy()
        np.minimum.at(lowest, pairs[:, 0], rank[pairs[:, 1]])
        np.minimum.at(lowest, pairs[:, 1], rank[pairs[:, 0]])
        lowest_here = undecided & (lowest == rank)
        chosen |= lowest_here
        undecided &= ~lowest_here
        undecided[pairs[lowest_here[pairs[:, 0]], 1]] = False
        undecided[pairs[lowest_here[pairs[:, 1]], 0]] = False
        pairs = pairs[undecided[pairs].all(axis=1)]
    return np.flatnonzero(chosen)
