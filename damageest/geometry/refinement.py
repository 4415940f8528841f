"""A closed mesh made fine where it is needed, and points put into it as vertices."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.distance import closest_on_mesh

MOST_ROUNDS = 60


def find_nearest(mesh: Mesh, points: Floats) -> tuple[Ints, Floats]:
    """(faces (N,), places (N,3)): where on the mesh lies what is nearest to the points (N,3)."""
    _, face, place = closest_on_mesh(points, mesh)
    return face, place


def refine_at(mesh: Mesh, face: Ints, foot: Floats, edge: float) -> tuple[Mesh, Ints]:
    """The mesh, conforming as it was, with no edge longer than ``edge`` on the faces that hold the points ``foot``
    (N,3), which lie on its faces ``face`` (N,); and the faces that hold them now.

    Longest edges are halved (Rivara 1984), so that triangles grow coarser away from the points and none gets thin.
    """
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    for _ in range(MOST_ROUNDS):
        held = np.unique(face)
        corners = vertices[faces[held]]
        length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        if (length <= edge).all():
            break
        vertices, faces, parent = _split(vertices, faces, held[(length > edge).any(axis=1)])
        face = _find_holding(vertices, faces, parent, face, foot)
    return Mesh(vertices, faces), face


def halve_edges(mesh: Mesh, edge: float) -> Mesh:
    """The mesh, conforming as it was, with no edge longer than ``edge``, by halving the longest of each triangle."""
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    for _ in range(MOST_ROUNDS):
        corners = vertices[faces]
        long = (np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2) > edge).any(axis=1)
        if not long.any():
            break
        vertices, faces, _ = _split(vertices, faces, np.flatnonzero(long))
    return Mesh(vertices, faces)


def _split(vertices: Floats, faces: Ints, wanted: Ints) -> tuple[Floats, Ints, Ints]:
    """Halves the longest edge of the ``wanted`` faces and of all that this would leave with a node on their edge.

    Gives vertices, faces, and (F,) the face that each came from.
    """
    corners = vertices[faces]
    length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    longest = length.argmax(axis=1)
    faces = faces[np.arange(len(faces))[:, None], (longest[:, None] + np.arange(3)) % 3]
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
    edge = np.unique(ends[..., 0] * len(vertices) + ends[..., 1], return_inverse=True)[1].reshape(-1, 3)
    marked = np.zeros(int(edge.max()) + 1, dtype=bool)
    marked[edge[wanted, 0]] = True
    while (late := marked[edge].any(axis=1) & ~marked[edge[:, 0]]).any():
        marked[edge[late, 0]] = True
    middle = np.full(len(marked), -1)
    middle[marked] = len(vertices) + np.arange(int(marked.sum()))
    ends_of = np.zeros((len(marked), 2), dtype=np.int64)
    ends_of[edge.ravel()] = ends.reshape(-1, 2)
    vertices = np.concatenate([vertices, vertices[ends_of[marked]].mean(axis=1)])
    (a, b, c), (m, n, o) = faces.T, middle[edge].T
    second, third = n >= 0, o >= 0
    index = np.arange(len(faces))
    cut = m >= 0

    def some(where: Ints, *nodes: Ints) -> tuple[Ints, Ints]:
        return np.stack([node[where] for node in nodes], axis=1), index[where]

    # The longest edge ab is cut at m in all of them; bc at n and ca at o in some.
    pieces = [
        some(~cut, a, b, c),
        some(cut & ~third, a, m, c),
        some(cut & third, a, m, o),
        some(cut & third, m, c, o),
        some(cut & ~second, m, b, c),
        some(cut & second, m, b, n),
        some(cut & second, m, n, c),
    ]
    return vertices, np.concatenate([p for p, _ in pieces]), np.concatenate([p for _, p in pieces])


def _find_holding(vertices: Floats, faces: Ints, parent: Ints, face: Ints, foot: Floats) -> Ints:
    """The faces that hold points whose faces were split: one of those that came from it."""
    children = np.flatnonzero(np.isin(parent, face))
    found, _ = find_nearest(Mesh(vertices, faces[children]), foot)
    return np.asarray(children[found])


def insert_points(mesh: Mesh, face: Ints, foot: Floats) -> tuple[Mesh, Ints]:
    """The mesh with the points ``foot`` (N,3), on its faces ``face`` (N,), among its vertices, and their numbers (N,).

    A point close to a vertex is that vertex; one close to an edge is put a tenth of the triangle's height off it, and
    so are points so close together that a triangle would be split too often.
    """
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    image = np.full(len(foot), -1)
    for _ in range(4):
        waiting = np.flatnonzero(image < 0)
        if not len(waiting):
            break
        share = _find_shares(vertices[faces[face[waiting]]], foot[waiting])
        snapped = share.max(axis=1) > 0.8
        corner = faces[face[waiting], share.argmax(axis=1)]
        image[waiting[snapped]] = corner[snapped]
        waiting, share = waiting[~snapped], share[~snapped]
        first = np.unique(face[waiting], return_index=True)[1]
        chosen, at = waiting[first], np.maximum(share[first], 0.1)
        at /= at.sum(axis=1)[:, None]
        old = face[chosen]
        a, b, c = faces[old].T
        new = len(vertices) + np.arange(len(chosen))
        vertices = np.concatenate([vertices, np.einsum("ij,ijk->ik", at, vertices[faces[old]])])
        parent = np.concatenate([np.arange(len(faces)), old, old])
        faces[old] = np.stack([a, b, new], axis=1)
        faces = np.concatenate([faces, np.stack([b, c, new], axis=1), np.stack([c, a, new], axis=1)])
        image[chosen] = new
        if (image < 0).any():
            face = _find_holding(vertices, faces, parent, face, foot)
    rest = np.flatnonzero(image < 0)
    if len(rest):
        image[rest] = faces[face[rest], _find_shares(vertices[faces[face[rest]]], foot[rest]).argmax(axis=1)]
    return Mesh(vertices, faces), image


def _find_shares(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates (N,3) of points (N,3) in triangles (N,3,3), clipped to the triangle."""
    import trimesh

    share = np.asarray(trimesh.triangles.points_to_barycentric(corners, points, method="cramer"))
    share = np.clip(np.nan_to_num(share, nan=1 / 3), 0, 1)
    return np.asarray(share / share.sum(axis=1)[:, None])
