"""Signed distances of very many points, most of them on the surface: few are searched for, the others follow.

Where points are many, one in a small cell of space tells which triangle is nearest, and the height over its plane is
the distance of the others, as far as they are over that triangle, or over others in the same plane.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.voxels import CHUNK, MOST_ALONG, VoxelGrid

Flags = NDArray[np.bool_]
Exact = Callable[[Floats], tuple[Floats, Ints]]

PER_CELL = 16
"""Points of the surface in a cell, about."""

ROUNDS = 4
"""Times that a cell's points are given another triangle to be over."""

SHARP = np.radians(10.0)
"""Edges that turn by more have points beside them which are over one face and nearer to the other, by more than a
hundredth of their distance."""

CLEAR = 3.0
"""How far from the edges of its triangle a point beside a sharp edge has to be, in heights over it."""

PAD = 4


def signed_distance_by_cells(points: Floats, part: Mesh, near: float, exact: Exact) -> tuple[Floats, Ints]:
    """What ``exact`` gives of the points (N,3), signed distance (N,) and nearest triangle (N,), with far fewer of them
    searched for.

    Exact beyond ``near`` of the surface. Nearer, off by a hundredth of the distance at most, unless walls are thinner
    than twice ``near``: there it is the distance to a wall within ``near``, if not to the nearest.
    """
    low, high = part.bounds
    size = max(2 * near, np.sqrt(PER_CELL * part.area / len(points)), float((high - low).max()) / MOST_ALONG)
    lattice = VoxelGrid(low - PAD * size, size, np.ceil((high - low) / size).astype(np.int64) + 2 * PAD)
    sharp, bent = (_place_along(part, edges, size / 4) for edges in _find_creases(part, near / size))
    beside = lattice.mark_around(sharp, 1)
    # any two points of a cell are 1.74 of its edges apart
    plane = ~lattice.mark_around(np.concatenate([sharp, bent]), 2)

    frames, centre = _build_frames(part), part.bounds.mean(axis=0)
    cell = np.concatenate([lattice.number_cells(points[i : i + CHUNK]) for i in range(0, len(points), CHUNK)])
    signed, face = np.full(len(points), np.nan), np.zeros(len(points), np.int64)
    first = np.zeros(len(beside), np.int64)
    open_ = np.arange(len(points))
    for _ in range(ROUNDS):
        if not len(open_):
            break
        first[cell[open_[::-1]]] = open_[::-1]  # of points in one cell the first is written last, and stays
        seen = first[cell[open_]]
        asked = open_[seen == open_]
        signed[asked], face[asked] = exact(points[asked])
        follows = (seen != open_) & (np.abs(signed[seen]) <= near)
        open_, seen = open_[follows], seen[follows]
        rest = []
        for start in range(0, len(open_), CHUNK):
            some, over = open_[start : start + CHUNK], face[seen[start : start + CHUNK]]
            height, inside = _measure_heights(points[some] - centre, frames[over])
            # beside a sharp edge the other face is farther where that is true of the edge
            over_it = inside >= np.where(beside[cell[some]], CLEAR * np.abs(height), 0)
            good = (np.abs(height) <= near) & (over_it | plane[cell[some]])
            signed[some[good]], face[some[good]] = height[good], over[good]
            rest.append(some[~good])
        before, open_ = len(open_), np.concatenate(rest) if rest else open_[:0]
        if before - len(open_) < len(asked):  # triangles so small that few points share one
            break
    left = np.flatnonzero(np.isnan(signed))
    signed[left], face[left] = exact(points[left])
    return signed, face


def _find_creases(part: Mesh, slope: float) -> tuple[Ints, Ints]:
    """Edges (E,2) that are sharp or belong to other than two faces, and those that only bend."""
    edges = np.sort(part.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    code = edges[:, 0] * len(part.vertices) + edges[:, 1]
    order = np.argsort(code, kind="stable")
    start = np.flatnonzero(np.diff(code[order], prepend=-1))
    pair = np.diff(start, append=len(order)) == 2
    length = np.linalg.norm(part.cross, axis=1)
    normal = part.cross / np.maximum(length, 1e-300)[:, None]
    one, other = order[start[pair]], order[start[pair] + 1]
    turn = np.linalg.norm(normal[one // 3] - normal[other // 3], axis=1)
    odd, flush = edges[order[start[~pair]]], edges[one]
    return np.concatenate([odd, flush[turn > SHARP]]), flush[(turn <= SHARP) & (turn > 1e-3 * slope)]


def _place_along(part: Mesh, edges: Ints, step: float) -> Floats:
    """Points (M,3) along edges (E,2), their ends among them, no more than ``step`` apart."""
    a, b = part.vertices[edges[:, 0]], part.vertices[edges[:, 1]]
    count = np.ceil(np.linalg.norm(b - a, axis=1) / step).astype(np.int64) + 1
    of = np.repeat(np.arange(len(edges)), count)
    share = (np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)) / np.maximum(count[of] - 1, 1)
    return np.asarray(a[of] + share[:, None] * (b - a)[of])


def _build_frames(part: Mesh) -> Floats:
    """(F,4,4) per triangle four planes, about the middle of the bounds: its own, and those through its edges on it."""
    corners = part.triangles - part.bounds.mean(axis=0)
    normal = part.cross / np.maximum(np.linalg.norm(part.cross, axis=1), 1e-300)[:, None]
    inward = np.cross(normal[:, None], np.roll(corners, -1, axis=1) - corners)
    inward /= np.maximum(np.linalg.norm(inward, axis=2, keepdims=True), 1e-300)
    result = np.empty((len(corners), 4, 4))
    result[:, 0, :3], result[:, 0, 3] = normal, -np.einsum("fi,fi->f", normal, corners[:, 0])
    result[:, 1:, :3], result[:, 1:, 3] = inward, -np.einsum("fki,fki->fk", inward, corners)
    return result


def _measure_heights(points: Floats, frames: Floats) -> tuple[Floats, Floats]:
    """Height (N,) of points (N,3) over the plane of a triangle each, (N,4,4), and how far they are from its edges (N,)
    measured in that plane, negative beside the triangle."""
    value = np.einsum("nij,nj->ni", frames[:, :, :3], points) + frames[:, :, 3]
    return value[:, 0], np.minimum(np.minimum(value[:, 1], value[:, 2]), value[:, 3])
