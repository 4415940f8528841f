"""Takes crossings out of an open surface: OpenCASCADE splits no solid by faces that cross beside their common edges."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.edges import list_edges
from damageest.geometry.refinement import bisect_faces
from damageest.geometry.undoing import find_crossings
from damageest.geometry.vectors import measure_longest_edges

ROUNDS = 40
"""How often the places round crossings are looked for."""
WIDER = 4
"""Rounds after which a ring of vertices more is smoothed."""


def refine_crossings(mesh: Mesh, size: float) -> tuple[Mesh, Ints]:
    """The mesh with no edge longer than ``size`` round its crossings, and the face (F,) that each face came from: with
    large triangles, more of the surface would move than has to."""
    origin = np.arange(len(mesh.faces))
    for _ in range(ROUNDS):
        long = _find_near(mesh, 1)[mesh.faces].any(axis=1) & (measure_longest_edges(mesh.triangles) > size)
        if not long.any():
            break
        vertices, faces, parent = bisect_faces(mesh.vertices, mesh.faces, np.flatnonzero(long))
        mesh, origin = Mesh(vertices, faces), origin[parent]
    return mesh, origin


def untangle(mesh: Mesh, farthest: float, steps: int = 1) -> Mesh:
    """The mesh with the vertices round its crossings moved to the middle of their neighbours, until none is left;
    itself where it has none, where that does not help, or where a vertex would move by more than ``farthest``.

    ``steps``: how often places are smoothed before they are looked for again; more reach farther, and move more.
    """
    moved = mesh
    for number in range(ROUNDS):
        near = _find_near(moved, number // WIDER)
        if not near.any():
            break
        moved = _smooth(moved, near, steps)
        if np.linalg.norm(moved.vertices - mesh.vertices, axis=1).max() > farthest:
            return mesh
    else:
        return mesh
    return moved


def keep_apart(mesh: Mesh, before: Floats) -> Mesh:
    """The mesh with its vertices round crossings back at the places ``before`` (V,3), from which they were moved."""
    for number in range(ROUNDS // WIDER):
        near = _find_near(mesh, number)
        if not near.any():
            break
        mesh = Mesh(np.where(near[:, None], before, mesh.vertices), mesh.faces)
    return mesh


def _find_near(mesh: Mesh, rings: int) -> Flags:
    """(V,) the vertices of edges and faces that cross, and ``rings`` of neighbours round them."""
    edges, faces = find_crossings(mesh)
    near = np.zeros(len(mesh.vertices), bool)
    near[edges] = True
    near[mesh.faces[faces]] = True
    for _ in range(rings):
        near[mesh.faces[near[mesh.faces].any(axis=1)]] = True
    return near


def _smooth(mesh: Mesh, near: Flags, steps: int) -> Mesh:
    """The mesh with the vertices that are ``near`` moved half the way to the middle of their neighbours so often."""
    count = len(mesh.vertices)
    ends = np.unique(list_edges(mesh.faces), axis=0)
    ends = np.concatenate([ends, ends[:, ::-1]])
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(count, count)).tocsr()[near]
    total = np.maximum(np.asarray(graph.sum(axis=1)).ravel(), 1)
    vertices = mesh.vertices.copy()
    for _ in range(steps):
        vertices[near] += 0.5 * (np.asarray(graph @ vertices) / total[:, None] - vertices[near])
    return Mesh(vertices, mesh.faces)
