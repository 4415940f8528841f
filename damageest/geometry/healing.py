"""Repair of a triangle mesh that is nearly a solid. Only safe repairs are made, and each is reported."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, open_edges
from damageest.errors import InputError
from damageest.geometry.body_repair import label_bodies, orient_faces, resolve_bodies, split_pinches
from damageest.geometry.duplicates import find_duplicates, list_used
from damageest.geometry.vectors import cross_corners

_HOLE_EDGES = 12
"""Edges of a hole up to which it may be closed."""
_HOLE_AREA = 0.01
"""Largest share of the surface area for the squared diagonal of a hole of more than three edges."""


def heal(
    vertices: Floats, faces: Ints, gap: float = 0.0, outward: bool = False
) -> tuple[Floats, Ints, tuple[str, ...]]:
    """A watertight mesh from one that nearly is: vertices (V,3), faces (F,3), and a note (text) for each repair.

    Merges vertices, drops degenerate and duplicate faces, makes windings consistent and outward, closes holes of a few
    edges, turns shells by where they lie, and unites bodies that overlap. Vertices are merged up to 1e-5 of the
    diagonal of the bounds; holes have three edges, or up to 12 within 1 % of the surface area. ``gap``: how far the
    triangles may lie off the surface that they stand for; bodies that touch are united without thinner cavities.
    ``outward``: the windings are those of a CAD kernel, and a shell in another that faces outward is a body, not a
    cavity. Coordinates may be in any unit and frame, and stay in them.

    Raises InputError, with what is wrong, where and what to do, for a mesh that needs more than that.
    """
    vertices = np.asarray(vertices, dtype=np.float64)
    faces = np.asarray(faces, dtype=np.int64)
    if vertices.ndim != 2 or faces.ndim != 2 or vertices.shape[1] != 3 or faces.shape[1] != 3 or not len(faces):
        raise InputError("holds no triangles; a part must be a closed triangle mesh")
    if bad := int((~np.isfinite(vertices)).any(1).sum()):
        raise InputError(f"{bad} of its vertices are not finite numbers; export the part again")
    notes: list[str] = []
    vertices, faces = _merge_vertices(vertices, faces, notes)
    vertices, faces = _drop_degenerate(vertices, faces, notes)
    if not len(faces):
        raise InputError("all its triangles are degenerate; a part must enclose a volume")
    if open_edges(faces):
        faces = _drop_duplicate_faces(faces, notes)
        faces = _align_windings(vertices, faces, notes)
        faces = _fill_holes(vertices, faces, notes)
        vertices, faces = split_pinches(vertices, faces, notes)
    if open_edges(faces):
        raise InputError(_describe_open(vertices, faces))
    vertices, faces = resolve_bodies(vertices, faces, notes, gap, outward)
    return vertices, faces, tuple(notes)


def _merge_vertices(vertices: Floats, faces: Ints, notes: list[str]) -> tuple[Floats, Ints]:
    """Merges equal vertices. While the mesh is still open, merges vertices closer than 1e-7, 1e-6 and 1e-5 of the
    diagonal, if that leaves fewer odd edges."""
    is_soup = bool(len(faces)) and int(np.bincount(faces.ravel()).max()) == 1  # as in every STL file: open, surely
    if not is_soup and not open_edges(faces):
        return vertices, faces
    keep, inverse = find_duplicates(vertices)
    before = len(vertices)
    vertices, faces = vertices[keep], inverse[faces]
    soup = before == 3 * len(faces)  # as in every STL file, so not worth a note
    if len(vertices) < before and not soup:
        notes.append(f"merged {before - len(vertices)} duplicate vertices")
    diagonal = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    best = _count_odd_edges(faces)
    for reach in (1e-7, 1e-6, 1e-5):
        if not best:
            break
        import scipy.sparse as sparse
        from scipy.sparse.csgraph import connected_components
        from scipy.spatial import cKDTree

        pairs = cKDTree(vertices).query_pairs(reach * diagonal, output_type="ndarray")
        if not len(pairs):
            continue
        graph = sparse.coo_matrix((np.ones(len(pairs), bool), pairs.T), shape=(len(vertices),) * 2)
        label = connected_components(graph, directed=False)[1].astype(np.int64)
        _, first = np.unique(label, return_index=True)
        merged = label[faces]
        open_now = _count_odd_edges(merged[_is_proper(merged)])
        if open_now < best:
            best = open_now
            notes.append(
                f"merged {len(vertices) - len(first)} vertices closer than {reach * diagonal:.2g} to another one"
            )
            vertices, faces = vertices[first], merged
    return vertices, faces


def _is_proper(faces: Ints) -> NDArray[np.bool_]:
    """Whether the three vertices of each face differ (F,)."""
    a, b, c = faces.T
    proper: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return proper


def _list_edges(faces: Ints) -> tuple[Ints, Ints, Ints]:
    """Undirected edges (E,2), the number of the edge for each of the 3F directed ones, and how many triangles each edge
    has (E,)."""
    directed = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    size = int(faces.max()) + 1
    codes, inverse, counts = np.unique(directed[:, 0] * size + directed[:, 1], return_inverse=True, return_counts=True)
    return np.column_stack([codes // size, codes % size]), inverse.reshape(-1), counts


def _count_odd_edges(faces: Ints) -> int:
    """How many edges have an odd number of triangles; 0 for no faces."""
    return int((_list_edges(faces)[2] % 2).sum()) if len(faces) else 0


def _drop_degenerate(vertices: Floats, faces: Ints, notes: list[str]) -> tuple[Floats, Ints]:
    """Drops triangles with a repeated corner and vertices that no triangle uses."""
    proper = _is_proper(faces)
    if not proper.all():
        notes.append(f"dropped {int((~proper).sum())} triangles with a repeated corner")
        faces = faces[proper]
    used = list_used(faces)
    if len(used) < len(vertices):
        index = np.zeros(len(vertices), np.int64)
        index[used] = np.arange(len(used))
        vertices, faces = vertices[used], index[faces]
    return vertices, faces


def _drop_duplicate_faces(faces: Ints, notes: list[str]) -> Ints:
    """Keeps one of several triangles on the same vertices; or none of an even number, where the mesh then has fewer
    open edges."""
    _, first, counts = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    if (counts == 1).all():
        return faces
    one = faces[np.sort(first)]
    none = faces[np.sort(first[counts % 2 == 1])]

    def defects(mesh: Ints) -> int:
        return int((_list_edges(mesh)[2] != 2).sum()) if len(mesh) else 3 * len(faces)

    kept = one if defects(one) <= defects(none) else none
    notes.append(f"dropped {len(faces) - len(kept)} triangles that lie exactly on another one")
    return kept


def _align_windings(vertices: Floats, faces: Ints, notes: list[str]) -> Ints:
    """Makes the windings of neighbouring triangles agree."""
    turned, flipped = orient_faces(faces)
    if flipped is None:
        raise InputError(
            "its surface is one-sided (like a Moebius strip), so its triangles have no consistent winding; "
            "export it again as a solid"
        )
    if flipped:
        notes.append(f"reversed {flipped} triangles whose winding disagreed with their neighbours")
    return turned


def _trace_hole_loops(faces: Ints) -> list[Ints]:
    """The closed loops of vertices along the boundary, against the direction of the triangles, so that a patch on a
    loop continues the winding. Loops that touch in a vertex are separated there."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, inverse, counts = _list_edges(faces)
    follow: dict[int, list[int]] = {}
    for start, end in directed[counts[inverse] == 1].tolist():
        follow.setdefault(end, []).append(start)
    loops = []
    for begin in list(follow):
        path: list[int] = []
        place: dict[int, int] = {}
        at = begin
        while True:
            if at in place:  # the path returns to a vertex: the part since then is a loop
                loop = path[place[at] :]
                for vertex in loop:
                    del place[vertex]
                del path[len(path) - len(loop) :]
                loops.append(np.array(loop, dtype=np.int64))
            place[at] = len(path)
            path.append(at)
            if not follow.get(at):
                break
            at = follow[at].pop()
    return [loop for loop in loops if len(loop) >= 3]


def _fill_holes(vertices: Floats, faces: Ints, notes: list[str]) -> Ints:
    """Closes holes that a few missing triangles leave: of three edges, or of up to 12 and 1 % of the surface area."""
    corners = vertices[faces]
    area = np.linalg.norm(cross_corners(corners), axis=1).sum() / 2
    patches: list[Ints] = []
    for loop in _trace_hole_loops(faces):
        if len(loop) > _HOLE_EDGES:
            continue
        patch = _triangulate_loop(vertices, loop)
        ring = vertices[loop]
        span = np.ptp(ring, axis=0)
        if len(loop) == 3 or float(span @ span) <= _HOLE_AREA * area:
            patches.append(patch)
    if not patches:
        return faces
    filled = np.concatenate([faces, *patches])
    added = len(filled) - len(faces)
    notes.append(f"closed {len(patches)} small hole{'s' * (len(patches) > 1)} with {added} triangle{'s' * (added > 1)}")
    return filled


def _triangulate_loop(vertices: Floats, loop: Ints) -> Ints:
    """Triangles (T,3) over a small loop with the least total area (dynamic programming over its diagonals)."""
    n = len(loop)
    p = vertices[loop]
    cost = np.zeros((n, n))
    split = np.zeros((n, n), np.int64)
    for gap in range(2, n):
        for i in range(n - gap):
            j = i + gap
            between = np.arange(i + 1, j)
            areas = np.linalg.norm(np.cross(p[between] - p[i], p[j] - p[i]), axis=1)
            total = cost[i, between] + cost[between, j] + areas
            best = int(np.argmin(total))
            cost[i, j], split[i, j] = total[best], between[best]
    triangles: list[tuple[int, int, int]] = []
    stack: list[tuple[int, int]] = [(0, n - 1)]
    while stack:
        i, j = stack.pop()
        if j - i < 2:
            continue
        k = int(split[i, j])
        triangles.append((int(loop[i]), int(loop[k]), int(loop[j])))
        stack += [(i, k), (k, j)]
    return np.array(triangles, dtype=np.int64)


def _describe_open(vertices: Floats, faces: Ints) -> str:
    """The message on a mesh that is not closed: what is wrong, where, and what to do."""
    edges, _, counts = _list_edges(faces)
    parts = []
    for which, name in (
        (counts == 1, "open edges (a triangle on one side only)"),
        (counts > 2, "edges with more than two triangles"),
    ):
        if which.any():
            at = vertices[edges[which]].mean(1)
            places = "; ".join("({:.6g}, {:.6g}, {:.6g})".format(*p) for p in at[:3])
            box = f", all between {_format_point(at.min(0))} and {_format_point(at.max(0))}" if len(at) > 3 else ""
            parts.append(f"{int(which.sum())} {name}, the first at {places}{box}")
    _, bodies = label_bodies(faces)
    if not parts:
        parts.append(f"{open_edges(faces)} edges whose two triangles have opposite windings")
    return (
        f"not watertight: {'; '.join(parts)} ({len(faces)} triangles in {bodies} "
        f"piece{'s' * (bodies != 1)}). Export the part again as a solid, or close the mesh in a mesh editor; "
        "for a scan: part: {use: earlier_scan, path: ...}"
    )


def _format_point(p: Floats) -> str:
    """A point as text: '(1, 2.5, 3)'."""
    return "({:.6g}, {:.6g}, {:.6g})".format(*p)
