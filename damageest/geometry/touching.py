"""Solids that touch themselves: kept closed for readers that merge vertices at one place.

A Boolean operation may leave lines along which two sheets of a solid touch, each with its own vertices. A reader that
merges vertices finds edges of four triangles there, and takes the solid for open. Here such sheets are told apart as in
Gueziec and others, "Cutting and stitching" (2001), and moved apart.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Solid, open_edges
from damageest.geometry.duplicates import find_duplicates, list_used
from damageest.geometry.vectors import normalise

ROUNDS = 8
"""How often sheets are moved apart, each time farther than before."""
GROWTH = 1.6
SHEET_GAP = 1e-3
"""Distance, in tolerances, by which sheets that touch are separated."""
SAME_ANGLE = 1e-4
"""Angle in radians up to which two faces at an edge coincide."""
FLAT = 0.05
"""Length of the mean normal at a vertex below which the faces there lie on one another."""
SAME_VOLUME = 1e-6
"""Share of the volume within which sheets without volume may be removed."""
MAX_CHANGE = 1e-3
"""Largest share of the volume that may change."""


def separate_touching(solid: Solid, radius: float, gap: float, rounds: int = ROUNDS) -> Solid | None:
    """The solid, closed also for a reader that merges vertices up to ``radius`` apart; its own are merged so.

    Where it touches itself, its sheets are moved inward by ``gap``, or by some ``gap`` where that is not enough, in up
    to ``rounds`` steps; 1: nothing is moved. None where that does not help, or changes the volume by more than
    `MAX_CHANGE`.
    """
    shares = (1.0, 2.5, 0.4) if rounds > 1 else (1.0,)
    return next(filter(None, (_separate(solid, radius, share * gap, rounds) for share in shares)), None)


def _separate(solid: Solid, radius: float, gap: float, rounds: int) -> Solid | None:
    vertices, faces = solid.vertices, solid.faces
    for number in range(rounds):
        vertices, faces = merge_close(vertices, faces, radius)
        faces = _remove_flat(faces)
        if not len(faces):
            return None
        if not open_edges(faces):
            return _make_solid(vertices, faces, solid)
        if number:  # sheets that are joined at both ends of an edge are told apart in its middle
            vertices, faces = _halve_shared_edges(vertices, faces)
        split = _split_vertices(vertices, faces)
        if split is None:
            return None
        vertices, faces = _move_inward(vertices, *split, gap * GROWTH**number)
    return None


def separate_sheets(body: Any, origin: Floats, tolerance: float) -> Solid | None:
    """A Manifold, relative to ``origin`` (3,), as a Solid that stays closed when vertices are merged, for example by
    single precision near the origin. Its shape changes by some `SHEET_GAP`, in tolerances, where it touches itself, in
    the same way wherever it lies. None where it is empty; not changed where nothing helps."""
    from damageest.geometry.solids import to_solid

    found = to_solid(body, origin)
    if found is None:
        return None
    radius = max(SHEET_GAP / 10 * tolerance, 4 * float(np.finfo(np.float32).eps) * found.diagonal)
    # sheets without volume, as Booleans leave them, go first
    plain = to_solid(body.simplify(radius), origin)
    if plain is None or abs(plain.volume - found.volume) > SAME_VOLUME * found.volume:
        plain = found
    return separate_touching(plain, radius, 10 * radius) or separate_touching(found, radius, 10 * radius) or found


def merge_close(vertices: Floats, faces: Ints, radius: float) -> tuple[Floats, Ints]:
    """A mesh with all vertices (V,3) that are linked by distances up to ``radius`` merged to the first of them, and
    without the faces (F,3) that lose a corner by it. A radius of 0 merges equal vertices only."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    pairs = cKDTree(vertices).query_pairs(radius, output_type="ndarray")
    links = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(len(vertices),) * 2)
    _, first, group = np.unique(connected_components(links, directed=False)[1], return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")  # vertices keep their order
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    a, b, c = rank[group.reshape(-1)[faces]].T
    return vertices[first[order]], np.stack([a, b, c], axis=1)[(a != b) & (b != c) & (c != a)]


def _remove_flat(faces: Ints) -> Ints:
    """The faces without pairs that have the same corners and opposite directions: sheets without thickness."""
    corners = np.sort(faces, axis=1)
    even = (np.argsort(faces, axis=1) @ [1, 3, 9])[:, None] == np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]]) @ [1, 3, 9]
    way = np.where(even.any(axis=1), 1, -1)
    same = find_duplicates(corners.astype(np.float64))[1]
    total = np.bincount(same, way)[same].astype(np.int64)
    # of each set of equal triangles as many are kept as are left over
    order = np.lexsort([way, same])
    where = np.empty_like(order)
    for direction in (1, -1):
        mine = order[way[order] == direction]
        starts = np.r_[True, same[mine][1:] != same[mine][:-1]] if len(mine) else np.zeros(0, bool)
        number = np.arange(len(mine)) - np.maximum.accumulate(np.where(starts, np.arange(len(mine)), 0))
        where[mine] = number
    return np.asarray(faces[where < way * total])


def _make_solid(vertices: Floats, faces: Ints, before: Solid) -> Solid | None:
    used = list_used(faces)
    try:
        found = Solid(vertices[used], np.searchsorted(used, faces))
    except ValueError:  # its volume is no more than the rounding
        return None
    return found if abs(found.volume - before.volume) <= MAX_CHANGE * before.volume else None


def _number_edges(faces: Ints) -> tuple[Ints, Ints]:
    """The edge (3F,) of each half-edge, and the number of half-edges (E,) of each edge."""
    start, stop = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    key = np.minimum(start, stop) * (int(faces.max()) + 1) + np.maximum(start, stop)
    _, edge, count = np.unique(key, return_inverse=True, return_counts=True)
    return edge.reshape(-1), count


def _halve_shared_edges(vertices: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """The mesh with a vertex in the middle of each edge of more than two faces; of those of one face, the first."""
    edge, count = _number_edges(faces)
    shared = np.where(count[edge] > 2, edge, len(count)).reshape(-1, 3)
    while True:  # an edge is halved in all of its faces or in none
        wanted = shared.min(axis=1)
        lost = np.unique(shared[(shared > wanted[:, None]) & (shared < len(count))])
        if not len(lost):
            break
        shared[np.isin(shared, lost)] = len(count)
    half = np.flatnonzero(shared.ravel() < len(count))
    a, b = faces.ravel()[half], faces.ravel()[_next_corner(half)]
    c = faces.ravel()[_next_corner(_next_corner(half))]
    _, first, which = np.unique(shared.ravel()[half], return_index=True, return_inverse=True)
    middle = which.reshape(-1) + len(vertices)
    fresh = (vertices[a[first]] + vertices[b[first]]) / 2
    whole = np.delete(faces, half // 3, axis=0)
    halves = [np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)]
    return np.concatenate([vertices, fresh]), np.concatenate([whole, *halves])


def _split_vertices(vertices: Floats, faces: Ints) -> tuple[Ints, Ints] | None:
    """The vertex (K,) that each new vertex is a copy of, and the faces (F,3) of new vertices, so that each edge has two
    faces: at an edge of more, those two that bound the same metal. None where the edges do not balance."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, forward = faces.ravel(), faces.ravel() < faces[:, [1, 2, 0]].ravel()
    edge, count = _number_edges(faces)
    order = np.lexsort([forward, edge])
    first = np.cumsum(count) - count
    plain = first[count == 2]
    pairs = [np.stack([order[plain], order[plain + 1]], axis=1)]
    if (forward[pairs[0]].sum(axis=1) != 1).any():
        return None
    for at, size in zip(first[count != 2], count[count != 2], strict=True):  # few
        found = _pair_round_edge(vertices, faces, order[at : at + size], forward)
        if found is None:
            return None
        pairs.append(found)
    one, two = np.concatenate(pairs).T
    # the corner where one half-edge starts is where its opposite ends
    links = np.concatenate([np.stack([one, _next_corner(two)], 1), np.stack([_next_corner(one), two], 1)])
    size = faces.size
    graph = coo_array((np.ones(len(links), bool), (links[:, 0], links[:, 1])), shape=(size, size))
    _, corner = connected_components(graph, directed=False)
    _, owner = np.unique(corner, return_index=True)
    return start[owner], corner.astype(np.int64).reshape(-1, 3)


def _next_corner(corner: Ints) -> Ints:
    return corner // 3 * 3 + (corner % 3 + 1) % 3


def _pair_round_edge(vertices: Floats, faces: Ints, corners: Ints, forward: Flags) -> Ints | None:
    """Pairs (P,2) of the half-edges ``corners`` (2P,) at one edge, with metal between the two faces of each."""
    way = forward[corners]
    if 2 * way.sum() != len(way):
        return None
    lead = corners[way][0]
    a, b = vertices[faces.ravel()[[lead, _next_corner(lead)]]]
    axis = (b - a) / np.linalg.norm(b - a)
    away = vertices[faces.ravel()[_next_corner(_next_corner(corners))]] - a
    side = away[0] - (away[0] @ axis) * axis
    angle = (np.arctan2(away @ np.cross(axis, side), away @ side) + SAME_ANGLE) % (2 * np.pi)
    # metal lies before a face that runs along the edge, and after one that runs against it; where two coincide, they
    # are taken to have a gap between them, so that all edges of one place are split alike
    rising = np.argsort(angle, kind="stable")
    rank = np.empty_like(rising)
    rank[rising] = np.cumsum(np.diff(angle[rising], prepend=0.0) > SAME_ANGLE)
    order = np.lexsort([angle, ~way, rank])
    rise = np.cumsum(np.where(way[order], -1, 1))
    turn = np.roll(order, -(int(np.argmin(rise)) + 1))
    open_faces: list[int] = []
    found = []
    for k in turn.tolist():
        if not way[k]:
            open_faces.append(k)
        else:
            found.append((corners[open_faces.pop()], corners[k]))
    return np.array(found, dtype=np.int64)


def _move_inward(vertices: Floats, origin: Ints, faces: Ints, by: float) -> tuple[Floats, Ints]:
    """The mesh with each vertex that has several copies moved inward by ``by``; ``origin`` (K,): what each copies."""
    points = vertices[origin]
    corners = points[faces]
    ways = normalise(corners[:, [1, 2, 0]] - corners)
    normal = normalise(np.cross(ways[:, 0], ways[:, 1]))
    cosine = -np.einsum("fkj,fkj->fk", ways, ways[:, [2, 0, 1]])
    weight = np.arccos(np.clip(cosine, -1, 1))
    total, inward, angle = np.zeros_like(points), np.zeros_like(points), np.zeros(len(points))
    for corner in range(3):
        np.add.at(total, faces[:, corner], weight[:, corner, None] * normal)
        np.add.at(inward, faces[:, corner], ways[:, corner] - ways[:, corner - 1])
        np.add.at(angle, faces[:, corner], weight[:, corner])
    # at the end of a sheet or slit without thickness there is no normal: there it is made shorter
    flat = np.linalg.norm(total, axis=1) < FLAT * angle
    total[flat] = -inward[flat]
    total = normalise(total)
    copied = np.bincount(origin, minlength=len(vertices))[origin] > 1
    return np.where(copied[:, None], points - by * total, points), faces
