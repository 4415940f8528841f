"""Points exactly on the sharp edges and corners of a mesh."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.edges import list_edges
from damageest.geometry.spreading import thin
from damageest.geometry.vectors import normalise

ON_EDGE, ON_CORNER = 1, 2


def find_sharp_edges(mesh: Mesh, angle: float) -> tuple[Ints, Ints]:
    """Vertex pairs (E,2) of edges at which the surface turns by more than ``angle`` degrees, and their faces (E,2)."""
    faces = mesh.faces
    edges = list_edges(faces)
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((face, edges[:, 1], edges[:, 0]))
    edges, face = edges[order], face[order]
    twin = np.flatnonzero((edges[1:, 0] == edges[:-1, 0]) & (edges[1:, 1] == edges[:-1, 1]))
    pairs, sides = edges[twin], np.stack([face[twin], face[twin + 1]], axis=1)
    normals = mesh.face_normals
    degenerate: NDArray[np.bool_] = np.asarray(~normals.any(axis=1))  # a face without area has no direction
    turn = np.einsum("ij,ij->i", normals[sides[:, 0]], normals[sides[:, 1]])
    sharp: NDArray[np.bool_] = (turn < np.cos(np.radians(angle))) & ~degenerate[sides].any(axis=1)
    return pairs[np.flatnonzero(sharp)], sides[np.flatnonzero(sharp)]


def place_sharp_points(mesh: Mesh, spacing: float, angle: float) -> tuple[Floats, Floats, Ints, NDArray[np.uint8]]:
    """Points exactly on sharp edges and corners, at most ``spacing`` apart along an edge.

    Returns:
        The points (N,3), their unit normals (N,3), which bisect those of the faces, one face (N,) of each, and their
        kind (N,): `ON_EDGE` or `ON_CORNER`.
    """
    pairs, sides = find_sharp_edges(mesh, angle)
    if not len(pairs):
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.uint8)
    normals = mesh.face_normals
    bisector = normalise(normals[sides].sum(axis=1))
    start, end = mesh.vertices[pairs[:, 0]], mesh.vertices[pairs[:, 1]]
    length = np.linalg.norm(end - start, axis=1)

    corner = _find_corners(mesh, pairs, angle)
    step = np.where(length > spacing, spacing, 0.4 * spacing)
    count = np.maximum(np.ceil(length / step).astype(np.int64), 1)
    of = np.repeat(np.arange(len(pairs)), count)
    at = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    points = start[of] + ((at + 0.5) / count[of])[:, None] * (end - start)[of]
    # Short segments, as of a finely tessellated circle, share points.
    short = np.flatnonzero(length[of] <= spacing)
    keep = np.sort(
        np.concatenate([np.flatnonzero(length[of] > spacing), short[thin(points[short], 0.5 * spacing, 0.6 * spacing)]])
    )
    points, of = points[keep], of[keep]

    vertex, where = np.unique(pairs.ravel(), return_inverse=True)
    sums = np.zeros((len(vertex), 3))
    np.add.at(sums, where, np.repeat(bisector, 2, axis=0))
    first_face = np.zeros(len(vertex), np.int64)
    first_face[where[::-1]] = np.repeat(sides[:, 0], 2)[::-1]
    is_corner = corner[vertex]
    return (
        np.concatenate([points, mesh.vertices[vertex[is_corner]]]),
        np.concatenate([bisector[of], normalise(sums[is_corner])]),
        np.concatenate([sides[of, 0], first_face[is_corner]]),
        np.concatenate([np.full(len(of), ON_EDGE), np.full(int(is_corner.sum()), ON_CORNER)]).astype(np.uint8),
    )


def _find_corners(mesh: Mesh, pairs: Ints, angle: float) -> NDArray[np.bool_]:
    """(V,) whether sharp edges end, branch or bend by more than ``angle`` degrees at a vertex."""
    count = np.bincount(pairs.ravel(), minlength=len(mesh.vertices))
    outward = normalise(mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]])
    sums = np.zeros((len(mesh.vertices), 3))
    np.add.at(sums, pairs[:, 0], outward)
    np.add.at(sums, pairs[:, 1], -outward)
    # The sum of two unit vectors along edges that bend by an angle t has length 2 sin(t/2).
    bent = np.linalg.norm(sums, axis=1) > 2 * np.sin(np.radians(angle) / 2)
    result: NDArray[np.bool_] = (count > 0) & ((count != 2) | bent)
    return result
