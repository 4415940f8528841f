"""What a displacement field moved, moved back: places, and meshes that are cut until their triangles follow. And
whether a mesh crosses itself after that."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from damageest.artefacts import DisplacementField, Floats, Ints, Mesh
from damageest.geometry.edges import list_edges
from damageest.geometry.rays import RayCaster
from damageest.geometry.refinement import bisect_faces
from damageest.geometry.vectors import cross_corners, normalise

MARGIN = 0.25
"""How far beyond its box a field goes on, as a share of the box's sides; farther away, each place is displaced as the
nearest one there is. Beyond that its polynomials would grow without bound."""
MOST_STEPS = 200
"""Steps in which places are looked for: each takes away the share of the error that the field's gradient leaves."""
FOUND = 1e-10
"""Distance, in diagonals of the field's box, within which they are."""
MOST_ROUNDS = 30
"""Rounds of cutting."""
TOUCHES = 1e-6
"""Distance of the ends of an edge from a face, in diagonals of the mesh, up to which the edge only touches it."""


def undo(field: DisplacementField, points: Floats) -> Floats:
    """(N,3) the places of the part as designed that the field moves to the points (N,3), by iteration.

    Raises ArithmeticError where a point has none that can be found: there the field folds.
    """
    side = field.high - field.low
    low, high = field.low - MARGIN * side, field.high + MARGIN * side
    near = FOUND * float(np.linalg.norm(side))
    places = np.array(points)
    left = np.arange(len(points))
    for _ in range(MOST_STEPS):
        if not len(left):
            return places
        after = points[left] - field.displace(np.clip(places[left], low, high))
        off = np.linalg.norm(after - places[left], axis=1)
        places[left] = after
        left = left[off > near]
    raise ArithmeticError(f"{len(left)} of {len(points)} places cannot be moved back: the field folds there")


def cut_to_follow(mesh: Mesh, move: Callable[[Floats], Floats], within: float) -> tuple[Floats, Ints]:
    """Moved vertices (V,3) and faces (F,3) of a mesh, cut until its moved triangles lie ``within`` this of what its own
    triangles are moved to, at the middles of edges and of faces. A closed mesh stays closed."""
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    moved = move(vertices)
    unknown = np.arange(len(faces))
    for _ in range(MOST_ROUNDS):
        wanted = unknown[_measure_off(vertices, moved, faces[unknown], move) > within]
        if not len(wanted):
            break
        before = faces
        vertices, faces, parent = bisect_faces(vertices, faces, wanted)
        moved = np.concatenate([moved, move(vertices[len(moved) :])])
        is_same = (np.sort(faces, axis=1) == np.sort(before[parent], axis=1)).all(axis=1)
        unknown = np.flatnonzero(~is_same)
    return moved, faces


def _measure_off(vertices: Floats, moved: Floats, faces: Ints, move: Callable[[Floats], Floats]) -> Floats:
    """(F,) how far the moved triangles lie off at most."""
    ends = list_edges(faces)
    edges, row = np.unique(ends, axis=0, return_inverse=True)
    middle = move(vertices[edges].mean(axis=1)) - moved[edges].mean(axis=1)
    inside = move(vertices[faces].mean(axis=1)) - moved[faces].mean(axis=1)
    of_edges = np.linalg.norm(middle, axis=1)[row].reshape(-1, 3)
    return np.asarray(np.maximum(of_edges.max(axis=1), np.linalg.norm(inside, axis=1)))


def count_crossings(mesh: Mesh) -> int:
    """How many edges of a mesh cross one of its faces that they have no vertex in common with, within 1e-6 of its
    size: none where it does not intersect itself."""
    return len(find_crossings(mesh)[1])


def find_crossings(mesh: Mesh) -> tuple[Ints, Ints]:
    """(N,2) the edges of a mesh and (N,) the faces that they cross, as `count_crossings` counts them."""
    if not len(mesh.faces):
        return np.empty((0, 2), np.int64), np.empty(0, np.int64)
    ends = list_edges(mesh.faces)
    edges = np.unique(ends, axis=0)
    found = RayCaster(mesh).find_crossings(mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]])
    own, corners = edges[found.ray], mesh.take_triangles(found.face)
    is_apart = (mesh.faces[found.face][:, :, None] != own[:, None, :]).all(axis=(1, 2))
    # rays are in single precision: of an edge within a plane of faces they cross some
    normal = normalise(cross_corners(corners))
    height = np.einsum("nej,nj->ne", mesh.vertices[own] - corners[:, None, 0], normal)
    crosses = (height.min(axis=1) < -TOUCHES * mesh.diagonal) & (height.max(axis=1) > TOUCHES * mesh.diagonal)
    return own[is_apart & crosses], np.asarray(found.face)[is_apart & crosses]
