"""Signed distances of very many points, most of them near the surface, with a nearest-triangle search for few of them.

Space is divided into small cells. The nearest triangle is searched for one point of a cell. The distance of the other
points in the cell is their height over the plane of that triangle, provided they lie over the triangle, or over others
in the same plane.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.duplicates import order_integers
from damageest.geometry.edges import list_edges
from damageest.geometry.sampling import place_along
from damageest.geometry.vectors import normalise
from damageest.geometry.voxels import CHUNK, MOST_ALONG, VoxelGrid
from damageest.isolation.memory import FEWER_POINTS, require_memory

Exact = Callable[[Floats], tuple[Floats, Ints]]

BYTES_OF_POINT, BYTES_OF_TRIANGLE = 170, 500
"""Memory for each point and each triangle, beside that of ``exact``, measured."""

PER_CELL = 16
"""About how many points on the surface lie in a cell."""

ROUNDS = 4
"""How often the points of a cell that are not over its triangle are tried with the triangle of another point."""

SHARP = np.radians(10.0)
"""Angle in radians between two faces above which their edge is sharp: points beside it may be over one face and nearer
to the other, by more than 1 % of their distance."""

CLEAR = 3.0
"""A point beside a sharp edge has to be this many times its height over the triangle away from the triangle's edges."""

PAD = 4
"""Layers of empty cells around the part."""


def signed_distance_by_cells(points: Floats, part: Mesh, near: float, exact: Exact) -> tuple[Floats, Ints]:
    """Signed distance (N,) of points (N,3) to the part, positive outside, and the nearest triangle (N,).

    Farther than ``near`` from the surface the values are those of ``exact``. Within ``near`` they differ from them by
    at most 1 % of the distance. Where a wall is thinner than twice ``near``, the distance may be that to the farther of
    its two sides, if that side is within ``near``.

    Args:
        points: (N,3) in the frame of the part.
        part: the triangles that ``exact`` measures to.
        near: length, in the unit of the points.
        exact: gives signed distance and nearest triangle of some of the points, as
            `damageest.geometry.distance.signed_distance` does with the part given.
    """
    if not len(points):
        return np.empty(0), np.empty(0, np.int64)
    needed = BYTES_OF_POINT * len(points) + BYTES_OF_TRIANGLE * len(part.faces)
    require_memory(needed, f"the distances of {len(points):,} points to the part", FEWER_POINTS)
    low, high = part.bounds
    size = max(2 * near, np.sqrt(PER_CELL * part.area / len(points)), float((high - low).max()) / MOST_ALONG)
    grid = VoxelGrid(low - PAD * size, size, np.ceil((high - low) / size).astype(np.int64) + 2 * PAD)
    sharp, bent = (place_along(part.vertices, edges, size / 4) for edges in _find_creases(part, near / size))
    beside = grid.mark_around(sharp, 1)
    # any two points of a cell are at most 1.74 of its edges apart
    plane = ~grid.mark_around(np.concatenate([sharp, bent]), 2)

    frames, centre = _build_frames(part), part.bounds.mean(axis=0)
    cell = np.concatenate([grid.number_cells(points[i : i + CHUNK]) for i in range(0, len(points), CHUNK)])
    signed, face = np.full(len(points), np.nan), np.zeros(len(points), np.int64)
    first = np.zeros(len(beside), np.int64)
    waiting = np.arange(len(points))
    for _ in range(ROUNDS):
        if not len(waiting):
            break
        first[cell[waiting[::-1]]] = waiting[::-1]  # in reverse, so that the first point of each cell remains
        guide = first[cell[waiting]]
        searched = waiting[guide == waiting]
        signed[searched], face[searched] = exact(points[searched])
        is_guided = (guide != waiting) & (np.abs(signed[guide]) <= near)
        waiting, guide = waiting[is_guided], guide[is_guided]
        remaining = []
        for start in range(0, len(waiting), CHUNK):
            batch, over = waiting[start : start + CHUNK], face[guide[start : start + CHUNK]]
            height, inside = _measure_heights(points[batch] - centre, frames[over])
            # beside a sharp edge, the other face is farther off than this one if the edge is
            is_over = inside >= np.where(beside[cell[batch]], CLEAR * np.abs(height), 0)
            is_valid = (np.abs(height) <= near) & (is_over | plane[cell[batch]])
            signed[batch[is_valid]], face[batch[is_valid]] = height[is_valid], over[is_valid]
            remaining.append(batch[~is_valid])
        before, waiting = len(waiting), np.concatenate(remaining) if remaining else waiting[:0]
        if before - len(waiting) < len(searched):  # triangles are so small that few points lie over the same one
            break
    remaining_points = np.flatnonzero(np.isnan(signed))
    signed[remaining_points], face[remaining_points] = exact(points[remaining_points])
    return signed, face


def _find_creases(part: Mesh, slope: float) -> tuple[Ints, Ints]:
    """Edges (E,2) that are sharp or do not belong to exactly two faces, and edges (E,2) where the surface bends by more
    than a thousandth of ``slope`` (radians) but is not sharp."""
    edges = list_edges(part.faces)
    code = edges[:, 0] * len(part.vertices) + edges[:, 1]
    order = order_integers(code)
    start = np.flatnonzero(np.diff(code[order], prepend=-1))
    pair = np.diff(start, append=len(order)) == 2
    length = 2 * part.face_areas
    normal = part.cross / np.maximum(length, 1e-300)[:, None]
    one, other = order[start[pair]], order[start[pair] + 1]
    turn = np.linalg.norm(normal[one // 3] - normal[other // 3], axis=1)
    odd, flush = edges[order[start[~pair]]], edges[one]
    return np.concatenate([odd, flush[turn > SHARP]]), flush[(turn <= SHARP) & (turn > 1e-3 * slope)]


def _build_frames(part: Mesh) -> Floats:
    """Four planes per triangle (F,4,4), relative to the centre of the bounds: its own, and the ones through its edges
    perpendicular to it, facing inward."""
    corners = part.triangles - part.bounds.mean(axis=0)
    normal = part.face_normals
    inward = np.cross(normal[:, None], np.roll(corners, -1, axis=1) - corners)
    inward = normalise(inward)
    result = np.empty((len(corners), 4, 4))
    result[:, 0, :3], result[:, 0, 3] = normal, -np.einsum("fi,fi->f", normal, corners[:, 0])
    result[:, 1:, :3], result[:, 1:, 3] = inward, -np.einsum("fki,fki->fk", inward, corners)
    return result


def _measure_heights(points: Floats, frames: Floats) -> tuple[Floats, Floats]:
    """Height (N,) of each of the points (N,3) over the plane of one triangle, given by its planes (N,4,4), and its
    distance (N,) to the triangle's edges in that plane, negative beside the triangle."""
    value = np.einsum("nij,nj->ni", frames[:, :, :3], points) + frames[:, :, 3]
    return value[:, 0], np.minimum(np.minimum(value[:, 1], value[:, 2]), value[:, 3])
