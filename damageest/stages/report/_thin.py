"""Points and triangles thinned to what a screen shows."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.edges import list_edges
from damageest.geometry.neighbourhoods import pick_one_per_cube
from damageest.geometry.voxels import number_cubes

ENOUGH = 8
"""Points for each one that is shown, among which these are chosen."""


def thin_points(points: Floats, most: int) -> Ints:
    """Indices, ascending, of at most ``most`` of the points (N,3), spread evenly: one for each cube of a grid."""
    chosen = np.arange(len(points))
    if len(points) <= most:
        return chosen
    if len(points) > ENOUGH * most:  # cubes are filled by chance, as by all points
        chosen = np.flatnonzero(np.random.default_rng(0).random(len(points)) < ENOUGH * most / len(points))
    some = points[chosen]
    edge = float(np.linalg.norm(np.ptp(some, axis=0))) / np.sqrt(most)
    for _ in range(12):
        first = pick_one_per_cube(some, edge)
        if len(first) > most:
            return chosen[first[np.linspace(0, len(first) - 1, most).astype(np.int64)]]
        if len(first) > 0.7 * most:
            break
        edge *= 0.8
    return chosen[first]


def thin_mesh(mesh: Mesh, most: int) -> Mesh:
    """A mesh for display with about ``most`` triangles at most: vertices of one cube of a grid become one.

    Flat areas keep their large triangles; details smaller than the cubes are lost.
    """
    if len(mesh.faces) <= most:
        return mesh
    edge = np.sqrt(mesh.area / most)
    for _ in range(12):
        first, number = np.unique(number_cubes(mesh.vertices, edge)[1], return_index=True, return_inverse=True)[1:]
        faces = number[mesh.faces]
        faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
        if len(faces) <= most:
            break
        edge *= 1.25
    return Mesh(mesh.vertices[first], faces)


def find_sharp_edges(mesh: Mesh, degrees: float = 30.0) -> Ints:
    """Edges (E,2), as vertex indices, where the faces of a closed mesh meet at more than an angle."""
    edges = list_edges(mesh.faces)
    face = np.repeat(np.arange(len(mesh.faces)), 3)
    number = edges[:, 0] * len(mesh.vertices) + edges[:, 1]
    order = np.argsort(number, kind="stable")
    same = np.flatnonzero(number[order][1:] == number[order][:-1])
    left, right = face[order[same]], face[order[same + 1]]
    cosine = np.einsum("ij,ij->i", mesh.face_normals[left], mesh.face_normals[right])
    return np.asarray(edges[order[same[cosine < np.cos(np.radians(degrees))]]])
