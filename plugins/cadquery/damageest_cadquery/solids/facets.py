"""Joins the triangles of a solid to planar faces, so that a flat side of the part is one face again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Solid
from damageest.geometry.vectors import normalise

FLAT = 1e-8
"""Largest distance of corners from their common face or edge, in diagonals of the solid."""

_POINT = 1e-12
"""Length below which an edge has no direction."""


@dataclass(frozen=True, eq=False)
class Facet:
    """A planar face: its outward unit ``normal`` and ``loops`` of vertex indices, the outer one first."""

    normal: Floats
    loops: tuple[Ints, ...]


def weld(solid: Solid) -> Solid:
    """The solid with the two ends of each edge without length merged, and without the triangles that collapse;
    unchanged where this would open it."""
    edges = np.concatenate([solid.faces[:, :2], solid.faces[:, 1:]])
    short = edges[np.linalg.norm(solid.vertices[edges[:, 0]] - solid.vertices[edges[:, 1]], axis=1) <= _POINT]
    if not len(short):
        return solid
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = len(solid.vertices)
    graph = coo_array((np.ones(len(short), bool), (short[:, 0], short[:, 1])), shape=(size, size))
    _, first, same = np.unique(connected_components(graph, directed=False)[1], return_index=True, return_inverse=True)
    a, b, c = first[same.reshape(-1)[solid.faces]].T
    faces = np.stack([a, b, c], axis=1)[(a != b) & (b != c) & (c != a)]
    try:
        return Solid(solid.vertices, faces)
    except ValueError:
        return solid


def find_facets(solid: Solid) -> list[Facet]:
    """The solid's planar faces. Each edge is shared by two of them, once in either direction."""
    vertices, faces = solid.vertices, solid.faces
    tolerance = FLAT * solid.diagonal
    edges = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)  # (F,3,2)
    other = _find_neighbours(edges, len(vertices))
    label = _find_flat_regions(solid, other, tolerance)
    label = _split_ambiguous(label, edges, other, len(vertices))
    # a piece that is flat within rounding, as a sliver between two bodies, is one region without an outline
    label = _split_off(label, ~np.isin(label, _find_outline(label, edges, other)[0]))
    loops, owner = _trace_loops(label, edges, other, len(vertices))
    loops = straighten(loops, vertices, tolerance)
    normal = np.zeros((label.max() + 1, 3))
    np.add.at(normal, label, solid.cross)
    normal = normalise(normal)
    area = np.einsum("lj,lj->l", _measure_areas(loops, vertices), normal[owner])
    order = np.lexsort([-area, owner])
    found: dict[int, list[Ints]] = {}
    for k in order:
        found.setdefault(int(owner[k]), []).append(loops[k])
    for region in np.flatnonzero(np.linalg.norm(normal, axis=1) < 0.5):  # without area: any plane through its line
        normal[region] = _find_perpendicular(vertices[found[int(region)][0]])
    return [Facet(normal[region], tuple(mine)) for region, mine in found.items()]


def take_triangles(solid: Solid) -> list[Facet]:
    """The solid's triangles, each as a face."""
    normals = normalise(solid.cross)
    for row in np.flatnonzero(np.linalg.norm(normals, axis=1) < 0.5):
        normals[row] = _find_perpendicular(solid.triangles[row])
    return [Facet(normal, (corners,)) for normal, corners in zip(normals, solid.faces, strict=True)]


def _find_perpendicular(loop: Floats) -> Floats:
    """(3,) a unit vector perpendicular to the line on which points (K,3) lie."""
    _, _, axes = np.linalg.svd(loop - loop.mean(0))
    return np.asarray(axes[-1])


def _find_neighbours(edges: Ints, count: int) -> Ints:
    """(F,3) the triangle on the other side of each edge."""
    start, end = edges.reshape(-1, 2).T
    forward, backward = start * count + end, end * count + start
    order = np.argsort(forward)
    other: Ints = order[np.searchsorted(forward, backward, sorter=order)] // 3
    return other.reshape(-1, 3)


def _find_flat_regions(solid: Solid, other: Ints, tolerance: float) -> Ints:
    """(F,) number of the flat region of each triangle; triangles of a region that bends too much are regions of their
    own."""
    vertices, faces, cross = solid.vertices, solid.faces, solid.cross
    size = np.linalg.norm(cross, axis=1)
    unit = cross / np.maximum(size, 1e-300)[:, None]
    one, two = np.repeat(np.arange(len(faces)), 3), other.reshape(-1)
    # compared with the plane of the larger of the two: the plane of a sliver is not exact
    here = (size[one] > size[two]) | ((size[one] == size[two]) & (one < two))
    one, two = one[here], two[here]
    off = np.einsum("nij,nj->ni", vertices[faces[two]] - vertices[faces[one, 0]][:, None], unit[one])
    sliver = size[two] <= tolerance * solid.diagonal
    flat = (np.abs(off).max(1) <= tolerance) & ((np.einsum("ij,ij->i", unit[one], unit[two]) > 0) | sliver)
    one, two = one[flat], two[flat]
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(one), bool), (one, two)), shape=(len(faces), len(faces)))
    label = connected_components(graph, directed=False)[1].astype(np.int64)
    normal = np.zeros((label.max() + 1, 3))
    np.add.at(normal, label, cross)
    normal = normalise(normal)
    height = np.einsum("nij,nj->ni", vertices[faces], normal[label])
    low, high = np.full(len(normal), np.inf), np.full(len(normal), -np.inf)
    np.minimum.at(low, label, height.min(1))
    np.maximum.at(high, label, height.max(1))
    return _split_off(label, (high - low > 2 * tolerance)[label])


def _split_off(label: Ints, lone: NDArray[np.bool_]) -> Ints:
    """The regions, renumbered; each ``lone`` triangle (F,) becomes its own region."""
    label = np.where(lone, label.max() + 1 + np.arange(len(label)), label)
    return np.unique(label, return_inverse=True)[1].reshape(-1).astype(np.int64)


def _split_ambiguous(label: Ints, edges: Ints, other: Ints, count: int) -> Ints:
    """Splits regions whose outline passes a vertex twice into triangles: their loops would be ambiguous."""
    region, start, _ = _find_outline(label, edges, other)
    codes, times = np.unique(region * count + start, return_counts=True)
    bad = np.unique(codes[times > 1] // count)
    return _split_off(label, np.isin(label, bad)) if len(bad) else label


def _find_outline(label: Ints, edges: Ints, other: Ints) -> tuple[Ints, Ints, Ints]:
    """The directed edges between regions: (region, start, end), each (E,)."""
    rows, sides = np.nonzero(label[:, None] != label[other])
    start, end = edges[rows, sides].T
    return label[rows], start, end


def _trace_loops(label: Ints, edges: Ints, other: Ints, count: int) -> tuple[list[Ints], Ints]:
    """The closed outlines as vertex indices, and the region (L,) that each belongs to."""
    region, start, end = _find_outline(label, edges, other)
    code = region * count + start
    order = np.argsort(code)
    following = order[np.searchsorted(code, region * count + end, sorter=order)].tolist()
    vertex, owner = start.tolist(), region.tolist()
    seen = [False] * len(vertex)
    loops, owners = [], []
    for first in range(len(vertex)):
        if seen[first]:
            continue
        loop, at = [], first
        while not seen[at]:
            seen[at] = True
            loop.append(vertex[at])
            at = following[at]
        loops.append(np.array(loop, dtype=np.int64))
        owners.append(owner[first])
    return loops, np.array(owners, dtype=np.int64)


def straighten(loops: list[Ints], vertices: Floats, tolerance: float) -> list[Ints]:
    """The loops without vertices in the middle of a straight edge between two faces."""
    if not loops:
        return []
    at = np.concatenate(loops)
    size = np.array([len(loop) for loop in loops])
    first = np.cumsum(size) - size
    before, after = np.roll(at, 1), np.roll(at, -1)
    before[first], after[first + size - 1] = at[first + size - 1], at[first]
    way = vertices[after] - vertices[before]
    length = np.maximum(np.linalg.norm(way, axis=1), 1e-300)
    off = np.linalg.norm(np.cross(vertices[at] - vertices[before], way), axis=1) / length
    along = np.einsum("ij,ij->i", vertices[at] - vertices[before], way) / length
    straight = (off <= tolerance) & (along > 0) & (along < length)
    uses, bent = np.bincount(at, minlength=len(vertices)), np.zeros(len(vertices), bool)
    bent[at[~straight]] = True
    keep = bent | (uses != 2)
    short = [loop for loop in loops if keep[loop].sum() < 3]
    if short:
        keep[np.concatenate(short)] = True
    return [loop[keep[loop]] for loop in loops]


def _measure_areas(loops: list[Ints], vertices: Floats) -> Floats:
    """(L,3) the vector areas of closed loops of vertices."""
    size = np.array([len(loop) for loop in loops])
    starts = np.cumsum(size) - size
    points = vertices[np.concatenate(loops)]
    off = points - np.repeat(points[starts], size, axis=0)
    after = np.roll(off, -1, axis=0)
    after[starts + size - 1] = 0.0  # the first point of each loop
    return np.asarray(np.add.reduceat(np.cross(off, after), starts, axis=0) / 2)
