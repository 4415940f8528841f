"""Local refinement of a closed mesh, and insertion of points as vertices.

Mesh, points and edge lengths are in one unit, mesh and points in one frame.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.duplicates import find_members, group_integers
from damageest.geometry.edges import list_edges
from damageest.geometry.vectors import cross_corners, measure_longest_edges
from damageest.isolation.memory import require_memory

BYTES_OF_FACE = 250
"""Memory of one round of refinement, for each triangle before or after it."""
BYTES_TO_LOOK = 320
"""Memory of the search for long edges, for each triangle, measured."""
RINGS = 2
"""Rings of neighbours of the faces to be halved that are looked at first."""
MOST_ROUNDS = 60
"""Rounds of halving after which refinement stops, even if edges are still too long."""


def find_nearest(mesh: Mesh, points: Floats) -> tuple[Ints, Floats]:
    """The place on the mesh nearest to each of the points (N,3): its face (N,) and its coordinates (N,3)."""
    _, face, place = closest_on_mesh(points, mesh)
    return face, place


def refine_at(mesh: Mesh, face: Ints, foot: Floats, edge: float) -> tuple[Mesh, Ints]:
    """The mesh refined around points on it, and the face (N,) of each point in the refined mesh.

    No edge of a face with such a point is longer than ``edge``. A closed mesh stays closed, and the surface is the same
    set of points. Longest edges are halved (Rivara 1984), so that triangles become larger away from the points and none
    becomes thin.

    Args:
        mesh: conforming: no vertex lies within an edge of another face.
        face: (N,) the face that each point lies on.
        foot: (N,3) the points, as `find_nearest` gives them.
        edge: longest edge allowed.
    """
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    for _ in range(MOST_ROUNDS):
        holders = np.unique(face)
        corners = vertices[faces[holders]]
        length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
        if (length <= edge).all():
            break
        vertices, faces, parent = bisect_faces(vertices, faces, holders[(length > edge).any(axis=1)])
        face = _find_new_faces(vertices, faces, parent, face, foot)
    return Mesh(vertices, faces), face


def halve_edges(mesh: Mesh, edge: float) -> Mesh:
    """The mesh with no edge longer than ``edge``, by halving the longest edge of each triangle (Rivara 1984).

    A closed mesh stays closed, and the surface is the same set of points.
    """
    return cut_into_cells(mesh, edge)[0]


def cut_into_cells(mesh: Mesh, edge: float, area: float = 0.0) -> tuple[Mesh, Ints]:
    """As `halve_edges`, with the face (F,) of ``mesh`` that each new face is a part of.

    Faces with less than ``area`` stay as they are, except where a neighbour is cut: a part has many long, thin
    triangles, and cutting all of them to this length would make ten times as many.
    """
    needed = BYTES_TO_LOOK * len(mesh.faces)
    require_memory(needed, f"a mesh of {len(mesh.faces):,} triangles that is cut", "a part with fewer triangles")
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    origin = asked = np.arange(len(faces))
    for _ in range(MOST_ROUNDS):
        corners = vertices[faces[asked]]
        long = measure_longest_edges(corners) > edge
        if area:
            cross = cross_corners(corners)
            long &= np.linalg.norm(cross, axis=1) > 2 * area
        if not long.any():
            break
        vertices, faces, parent, kept = _bisect(vertices, faces, asked[long])
        origin, asked = origin[parent], np.arange(kept, len(faces))  # a face that was not cut is not too long
    return Mesh(vertices, faces), origin


def cut_part(part: Part, edge: float) -> Part:
    """The part with no edge longer than ``edge``, as `cut_into_cells` cuts it; its triangles keep their CAD faces."""
    mesh, origin = cut_into_cells(part, edge)
    brep = None if part.faces_brep is None else part.faces_brep[origin]
    unseen = None if part.unseen is None else part.unseen[origin]
    return replace(part, vertices=mesh.vertices, faces=mesh.faces, faces_brep=brep, unseen=unseen)


def bisect_faces(vertices: Floats, faces: Ints, wanted: Ints) -> tuple[Floats, Ints, Ints]:
    """Halves the longest edge of the ``wanted`` faces, and of the faces that would otherwise have a vertex within an
    edge.

    Gives vertices, faces, and the face (F,) that each of them came from.
    """
    return _bisect(vertices, faces, wanted)[:3]


def _bisect(vertices: Floats, faces: Ints, wanted: Ints) -> tuple[Floats, Ints, Ints, int]:
    """As `bisect_faces`, with the number of faces that stay as they are; these come first.

    Only faces about the ``wanted`` ones are looked at, and more of them where halving goes on to faces beyond.
    """
    if not len(wanted):
        return vertices, faces, np.arange(len(faces)), len(faces)
    needed = BYTES_OF_FACE * (len(faces) + 3 * len(wanted))
    require_memory(needed, f"a mesh of {len(faces):,} triangles that is refined", "a larger tolerance")
    is_wanted = np.zeros(len(faces), bool)
    is_wanted[wanted] = True
    near = is_wanted
    while True:
        for _ in range(RINGS):
            touched = np.zeros(len(vertices), bool)
            touched[faces[near]] = True
            near = np.asarray(touched[faces].any(axis=1))
        chosen = np.flatnonzero(near)
        cut = _halve_some(vertices, faces[chosen], np.flatnonzero(is_wanted[chosen]))
        is_end = np.zeros(len(vertices), bool)
        is_end[cut.ends] = True
        if near.all() or not (is_end[faces[~near]].sum(axis=1) > 1).any():
            break  # no face that was not looked at has an edge that is halved
    stays = np.ones(len(faces), bool)
    stays[chosen[cut.parent]] = False
    kept = np.flatnonzero(stays)
    return (
        np.concatenate([vertices, cut.middles]),
        np.concatenate([faces[kept], cut.faces]),
        np.concatenate([kept, chosen[cut.parent]]),
        len(kept),
    )


class _Halves(NamedTuple):
    """What comes of faces that are halved: the ``ends`` (K,2) of the edges, their ``middles`` (K,3), which are vertices
    after those of the mesh, the new ``faces`` (P,3), and the ``parent`` (P,) of each among the faces asked."""

    ends: Ints
    middles: Floats
    faces: Ints
    parent: Ints


def _halve_some(vertices: Floats, faces: Ints, wanted: Ints) -> _Halves:
    """Halves the longest edges of the ``wanted`` of these faces (F,3), and those that this asks for among them."""
    corners = vertices[faces]
    length = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2)
    longest = length.argmax(axis=1)
    faces = faces[np.arange(len(faces))[:, None], (longest[:, None] + np.arange(3)) % 3]
    ends = list_edges(faces).reshape(-1, 3, 2)
    edge = group_integers((ends[..., 0] * len(vertices) + ends[..., 1]).ravel())[1].reshape(-1, 3)
    marked = np.zeros(int(edge.max()) + 1, dtype=bool)
    marked[edge[wanted, 0]] = True
    while (late := marked[edge].any(axis=1) & ~marked[edge[:, 0]]).any():
        marked[edge[late, 0]] = True
    middle = np.full(len(marked), -1)
    middle[marked] = len(vertices) + np.arange(int(marked.sum()))
    ends_of = np.zeros((len(marked), 2), dtype=np.int64)
    ends_of[edge.ravel()] = ends.reshape(-1, 2)
    (a, b, c), (m, n, o) = faces.T, middle[edge].T
    second, third = n >= 0, o >= 0
    index = np.arange(len(faces))
    cut = m >= 0

    def some(where: Flags, *nodes: Ints) -> tuple[Ints, Ints]:
        return np.stack([node[where] for node in nodes], axis=1), index[where]

    # The longest edge ab is cut at m in all of them; bc at n and ca at o in some.
    pieces = [
        some(cut & ~third, a, m, c),
        some(cut & third, a, m, o),
        some(cut & third, m, c, o),
        some(cut & ~second, m, b, c),
        some(cut & second, m, b, n),
        some(cut & second, m, n, c),
    ]
    halved = ends_of[marked]
    new, parent = (np.concatenate(column) for column in zip(*pieces, strict=True))
    return _Halves(halved, vertices[halved].mean(axis=1), new, parent)


def _find_new_faces(vertices: Floats, faces: Ints, parent: Ints, face: Ints, foot: Floats) -> Ints:
    """The face (N,) of each point after some faces were split; it is one of those that came from its face before."""
    children = np.flatnonzero(find_members(parent, face))
    found, _ = find_nearest(Mesh(vertices, faces[children]), foot)
    return np.asarray(children[found])


def insert_points(mesh: Mesh, face: Ints, foot: Floats) -> tuple[Mesh, Ints]:
    """The mesh with points on it inserted as vertices, and the vertex (N,) of each point.

    A point close to a vertex becomes that vertex. A point close to an edge is moved away from it, to a tenth of the
    triangle's height. Where many points lie in one triangle, the ones left after four rounds become the nearest corner
    of their triangle. A closed mesh stays closed, and the surface is the same set of points.

    Args:
        face: (N,) the face that each point lies on.
        foot: (N,3) the points, as `find_nearest` or `refine_at` leave them.
    """
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    vertex_of = np.full(len(foot), -1)
    for _ in range(4):
        waiting = np.flatnonzero(vertex_of < 0)
        if not len(waiting):
            break
        share = _measure_barycentric(vertices[faces[face[waiting]]], foot[waiting])
        snapped = share.max(axis=1) > 0.8
        corner = faces[face[waiting], share.argmax(axis=1)]
        vertex_of[waiting[snapped]] = corner[snapped]
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
        vertex_of[chosen] = new
        if (vertex_of < 0).any():
            face = _find_new_faces(vertices, faces, parent, face, foot)
    rest = np.flatnonzero(vertex_of < 0)
    if len(rest):
        vertex_of[rest] = faces[
            face[rest], _measure_barycentric(vertices[faces[face[rest]]], foot[rest]).argmax(axis=1)
        ]
    return Mesh(vertices, faces), vertex_of


def _measure_barycentric(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates (N,3) of points (N,3) in triangles (N,3,3), clipped to the triangle."""
    import trimesh

    share = np.asarray(trimesh.triangles.points_to_barycentric(corners, points, method="cramer"))
    share = np.clip(np.nan_to_num(share, nan=1 / 3), 0, 1)
    return np.asarray(share / share.sum(axis=1)[:, None])
