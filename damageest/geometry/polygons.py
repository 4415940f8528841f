"""Triangles of faces with more than three corners, concave ones included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise

LEAST_TURN = 1e-9
"""Least area of a triangle of a fan, in areas of the square on the polygon's longest edge; smaller ones have none."""


@dataclass(frozen=True)
class PolygonTriangles:
    """``faces`` (T,3) of the vertices; ``polygon`` (T,): which face each is part of; ``divided`` and ``concave``: how
    many faces have more than three corners, and of how many of these no fan from the first corner is a division."""

    faces: Ints
    polygon: Ints
    divided: int
    concave: int


def triangulate_polygons(vertices: Floats, corners: Ints, count: Ints) -> PolygonTriangles:
    """Divides polygons into triangles that use all their corners and no others.

    ``vertices`` (V,3); ``corners`` (C,): the vertices of the faces, one face after the other; ``count`` (F,): how many
    corners each face has; faces of fewer than three are left out. A face is divided by a fan from its first corner
    where all triangles of the fan face as the face does, else by the ear clipping of manifold3d in the plane of its
    mean normal (M. E. Newell's sum).
    """
    first = np.cumsum(count) - count
    faces, owner, concave = [], [], 0
    for size in np.unique(count[count >= 3]).tolist():
        which = np.flatnonzero(count == size)
        face = corners[first[which, None] + np.arange(size)]
        fans = np.stack([np.broadcast_to(face[:, :1], face[:, 2:].shape), face[:, 1:-1], face[:, 2:]], axis=2)
        valid = np.ones(len(which), bool) if size == 3 else _find_valid_fans(vertices, face)
        faces.append(fans[valid].reshape(-1, 3))
        owner.append(np.repeat(which[valid], size - 2))
        concave += int((~valid).sum())
        for number in np.flatnonzero(~valid).tolist():  # one call a face, as manifold3d has it; these are few
            divided = face[number][_clip_ears(vertices[face[number]])]
            faces.append(divided)
            owner.append(np.full(len(divided), which[number]))
    if not faces:
        return PolygonTriangles(np.empty((0, 3), np.int64), np.empty(0, np.int64), 0, 0)
    polygon = np.concatenate(owner)
    order = np.argsort(polygon, kind="stable")
    return PolygonTriangles(np.concatenate(faces)[order], polygon[order], int((count > 3).sum()), concave)


def _find_valid_fans(vertices: Floats, face: Ints) -> Flags:
    """Whether the fan from the first corner of each face (F,n) divides it."""
    ray = vertices[face] - vertices[face[:, :1]]
    edge = np.linalg.norm(np.diff(ray, axis=1, append=ray[:, :1]), axis=2).max(axis=1)
    turn = np.cross(ray[:, 1:-1], ray[:, 2:])
    facing = np.einsum("fij,fj->fi", turn, normalise(turn.sum(axis=1)))
    return np.asarray(facing.min(axis=1) > LEAST_TURN * edge**2)


def _clip_ears(outline: Floats) -> Ints:
    """The triangles (T,3) of one polygon (n,3), by the numbers of its corners."""
    import manifold3d

    ray = outline - outline[0]
    normal = normalise(np.cross(ray[1:-1], ray[2:]).sum(axis=0)[None])[0]
    if not normal.any():  # all corners on a line
        number = np.arange(1, len(outline) - 1)
        return np.column_stack([np.zeros_like(number), number, number + 1])
    across = normalise(np.cross(normal, np.eye(3)[np.abs(normal).argmin()])[None])[0]
    flat = ray @ np.column_stack([across, np.cross(normal, across)])
    return np.asarray(manifold3d.triangulate([flat]), dtype=np.int64)
