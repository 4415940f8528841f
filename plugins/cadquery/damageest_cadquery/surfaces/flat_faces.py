"""Flat faces of a simplified surface: regions of planes with their outlines, and single triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.vectors import normalise
from damageest_cadquery.solids.facets import FLAT, Facet, straighten
from damageest_cadquery.surfaces._recognise import Shape, find_neighbours

ROUNDS = 6
"""How often triangles without area are joined to their neighbours while outlines are repaired."""


@dataclass(frozen=True, eq=False)
class Flat:
    """``mesh``: triangles; ``label`` (F,): the plane of each, -1 for none; ``planes``: by label."""

    mesh: Mesh
    label: Ints
    planes: Sequence[Shape]


def find_flat_faces(flat: Flat) -> list[Facet]:
    """The planes' regions and the single triangles, with their outlines. A region whose outline would cross itself, or
    pass a vertex twice, stays as triangles."""
    mesh = flat.mesh
    region = split_regions(mesh.faces, flat.label)
    for number in range(2 * ROUNDS):
        if number < ROUNDS:
            region = _join_needles(mesh, region)
        loops, owners = _trace(region, mesh.faces, len(mesh.vertices))
        lone = _find_pinched(mesh, region, loops, owners)
        if not lone.any():
            facets = _gather(flat, region, straighten(loops, mesh.vertices, FLAT * mesh.diagonal), owners)
            lone = np.isin(region, [k for k, facet in facets.items() if not _is_simple(facet, mesh.vertices)])
            if not lone.any():
                return list(facets.values())
        region = np.where(lone, region.max() + 1 + np.arange(len(region)), region)
        region = _connect(mesh.faces, region, region >= 0)
    alone = np.arange(len(mesh.faces))
    loops, owners = _trace(alone, mesh.faces, len(mesh.vertices))
    return list(_gather(flat, alone, loops, owners).values())


def _trace(region: Ints, faces: Ints, size: int) -> tuple[list[Ints], Ints]:
    """The closed outlines of regions of triangles as vertex numbers, and the region (L,) of each."""
    start, end, of = faces.ravel(), np.roll(faces, -1, axis=1).ravel(), np.repeat(region, 3)
    outline = np.flatnonzero(~np.isin((of * size + start) * size + end, (of * size + end) * size + start))
    start, end, of = start[outline], end[outline], of[outline]
    order = np.argsort(of * size + start, kind="stable")
    key = (of * size + start)[order]
    after = order[np.searchsorted(key, of * size + end)].tolist()
    seen, loops, owners = [False] * len(after), [], []
    for first in range(len(after)):
        if seen[first]:
            continue
        way, at = [], first
        while not seen[at]:
            seen[at] = True
            way.append(at)
            at = after[at]
        loops.append(start[way])
        owners.append(of[first])
    return loops, np.array(owners)


def _join_needles(mesh: Mesh, region: Ints) -> Ints:
    """The regions, where one without area is joined to its neighbour over its longest edge."""
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    length = np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1)
    thick = 2 * mesh.face_areas > FLAT * mesh.diagonal * length.reshape(-1, 3).max(axis=1)
    size = len(mesh.vertices)
    code = start * size + end
    order = np.argsort(code)
    at = np.minimum(np.searchsorted(code, end * size + start, sorter=order), len(code) - 1)
    other = np.where(code[order[at]] == end * size + start, order[at] // 3, -1)
    mine = np.repeat(np.arange(len(region)), 3)
    for _ in range(8):
        thin = np.bincount(region, weights=thick) == 0
        crossing = np.flatnonzero((other >= 0) & thin[region[mine]] & (region[mine] != region[other]))
        if not len(crossing):
            break
        crossing = crossing[np.argsort(-length[crossing], kind="stable")]
        one, first = np.unique(region[mine[crossing]], return_index=True)
        two = region[other[crossing[first]]]
        graph = coo_array((np.ones(len(one), bool), (one, two)), shape=(int(region.max()) + 1,) * 2)
        region = np.asarray(connected_components(graph, directed=False)[1][region], np.int64)
    return region


def _find_pinched(mesh: Mesh, region: Ints, loops: list[Ints], owners: Ints) -> Flags:
    """(F,) triangles to leave out of their region so that its outlines pass no vertex twice: where several fans of a
    region meet in a vertex, all but the largest."""
    of = np.repeat(owners, [len(loop) for loop in loops])
    pairs, times = np.unique(np.column_stack([of, np.concatenate(loops)]), axis=0, return_counts=True)
    lone = np.zeros(len(region), bool)
    for owner, vertex in pairs[times > 1].tolist():
        rows = np.flatnonzero((region == owner) & (mesh.faces == vertex).any(axis=1))
        one, two = find_neighbours(mesh.faces[rows])
        graph = coo_array((np.ones(len(one), bool), (one, two)), shape=(len(rows),) * 2)
        fan = connected_components(graph, directed=False)[1]
        area = np.bincount(fan, weights=2 * mesh.face_areas[rows])
        lone[rows[fan != area.argmax()] if len(area) > 1 else rows] = True
    return lone


def _is_simple(facet: Facet, vertices: Floats) -> bool:
    """Whether the outlines of a face neither cross one another nor themselves."""
    if len(facet.loops) == 1 and len(facet.loops[0]) == 3:
        return True
    side = np.linalg.svd(facet.normal[None])[2][1:]
    loops = [(vertices[loop] - vertices[facet.loops[0][0]]) @ side.T for loop in facet.loops]
    start, end = np.concatenate(loops), np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    numbers = np.concatenate(facet.loops)
    after = np.concatenate([np.roll(loop, -1) for loop in facet.loops])

    def side_of(point: Floats) -> Floats:  # (N,N) of each segment's line on which each point lies
        way, off = end - start, point[None] - start[:, None]
        return np.asarray(np.sign(way[:, None, 0] * off[..., 1] - way[:, None, 1] * off[..., 0]))

    apart = (side_of(start) * side_of(end)) < 0
    joined = (numbers[:, None] == after) | (after[:, None] == numbers) | (numbers[:, None] == numbers)
    return not bool((apart & apart.T & ~joined).any())


def _gather(flat: Flat, region: Ints, loops: list[Ints], owners: Ints) -> dict[int, Facet]:
    """The faces by region, the outer outline of each first."""
    vertices = flat.mesh.vertices
    normal = np.zeros((int(region.max()) + 1, 3))
    np.add.at(normal, region, flat.mesh.cross)
    label = np.full(len(normal), -1)
    np.maximum.at(label, region, flat.label)
    for k, plane in enumerate(flat.planes):
        own = label == k
        normal[own] = plane.axis * np.sign(normal[own] @ plane.axis)[:, None]
    normal = normalise(normal)
    found: dict[int, list[tuple[float, Ints]]] = {}
    for loop, owner in zip(loops, owners.tolist(), strict=True):
        off = vertices[loop] - vertices[loop[0]]
        area = float(np.cross(off, np.roll(off, -1, axis=0)).sum(axis=0) @ normal[owner])
        found.setdefault(owner, []).append((-area, loop))
    return {
        owner: Facet(normal[owner], tuple(loop for _, loop in sorted(mine, key=lambda item: item[0])))
        for owner, mine in found.items()
    }


def split_regions(faces: Ints, label: Ints) -> Ints:
    """(F,) numbers of the connected regions of each plane; triangles without a plane are regions of their own."""
    return _connect(faces, label, label >= 0)


def _connect(faces: Ints, label: Ints, joined: Flags) -> Ints:
    """(F,) numbers of the connected regions of equal labels; triangles that are not ``joined`` (F,) stay alone."""
    one, two = find_neighbours(faces)
    same = (label[one] == label[two]) & joined[one]
    graph = coo_array((np.ones(same.sum(), bool), (one[same], two[same])), shape=(len(faces),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64)
