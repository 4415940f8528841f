"""The side of a mesh that points lie on, by the pseudonormals of a mesh that is kept for many questions.

libigl's `signed_distance` builds its tree and its normals anew for each call, and its tree holds long triangles as they
are. Where few points are asked of a mesh with many triangles, or triangles are long, that is most of its time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.long_faces import Tree
from damageest.geometry.threads import cut_evenly

CHUNK = 10_000
"""Points whose pseudonormals are found at a time, so that intermediate arrays stay in the processor's cache."""

ON_EDGE = 1e-12
"""Barycentric coordinate up to which a place lies on the opposite edge, as libigl takes it."""

FOLDED, SHARP = 0.1, 0.45
"""Where the mesh folds back: the cosine of the angle between the normals of a vertex and of a face there is less than
that; the sum of the normals of two faces is shorter than this, so that their edge is sharper than 26 degrees."""

MOST_WOUND = 100_000
"""Triangles up to which what gives the winding number is kept: 200 bytes for each."""

_last: WeakKeyDictionary[Mesh, SignedMesh] = WeakKeyDictionary()
"""The mesh that was asked last: more would hold memory that the next stages need."""


@dataclass(frozen=True, eq=False)
class SignedMesh:
    """The ``vertices`` (V,3) and ``faces`` (F,3) of a watertight mesh, without flat ones, near the origin; ``tree``: as
    `build_tree` gives it; ``whole`` (G,3): with the flat ones."""

    vertices: Floats
    faces: Ints
    tree: Tree
    whole: Ints

    @cached_property
    def _normals(self) -> tuple[Floats, Floats, Floats, Ints]:
        """The pseudonormals of faces (F,3), vertices (V,3) and edges (E,3), not of unit length for edges, and the edge
        (F,3) opposite each corner (Baerentzen and Aanaes 2005)."""
        import igl

        by_angle = igl.PerVertexNormalsWeightingType.PER_VERTEX_NORMALS_WEIGHTING_TYPE_ANGLE
        alike = igl.PerEdgeNormalsWeightingType.PER_EDGE_NORMALS_WEIGHTING_TYPE_UNIFORM
        of_face = igl.per_face_normals(self.vertices, self.faces, np.zeros(3))
        of_vertex = igl.per_vertex_normals(self.vertices, self.faces, by_angle)
        of_edge, _, opposite = igl.per_edge_normals(self.vertices, self.faces, alike)
        count = len(self.faces)
        return (
            of_face,
            of_vertex,
            of_edge,
            np.stack([np.ravel(opposite)[k * count : (k + 1) * count] for k in range(3)], 1),
        )

    @cached_property
    def folded(self) -> Flags:
        """Whether each face (F,) has an edge or a vertex at which the mesh folds back on itself. Where it crosses
        itself there, as damage volumes do in a few places, far points would get the wrong side."""
        of_face, of_vertex, of_edge, opposite = self._normals
        against = np.einsum("fi,fki->fk", of_face, of_vertex[self.faces]) < FOLDED
        vertex = np.zeros(len(self.vertices), bool)
        vertex[self.faces[against]] = True
        sharp = (np.linalg.norm(of_edge, axis=1) < SHARP)[opposite].any(axis=1)
        return np.asarray(vertex[self.faces].any(axis=1) | sharp)

    def wind(self, points: Floats) -> Floats:
        """The winding number (N,) of the mesh about points (N,3), as `winding_number`."""
        winding = self._winding if len(self.whole) <= MOST_WOUND else self._prepare_winding()
        return np.asarray(winding.winding_number(np.ascontiguousarray(points))).ravel()

    @cached_property
    def _winding(self) -> Any:
        return self._prepare_winding()

    def _prepare_winding(self) -> Any:
        import igl

        found = igl.FastWindingNumberBVH()
        found.init(self.vertices, np.array(self.whole))
        return found

    def measure(self, points: Floats) -> tuple[Floats, Ints, Floats, Floats]:
        """Signed distance (N,) of points (N,3), positive outside, the nearest face (N,), the nearest place (N,3) and
        the pseudonormal (N,3) there. Raises ValueError where the mesh has no triangle."""
        if not len(points):
            return np.empty(0), np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3))
        if not len(self.faces):  # libigl ends the process by a segmentation fault there
            raise ValueError("no distance: the target has no triangle; ask only where there is one")
        tree, vertices, faces, origin = self.tree
        squared, found, place = tree.squared_distance(vertices, faces, points)
        face, place = origin[np.ravel(found)], np.reshape(place, (-1, 3))
        some = cut_evenly(len(points), CHUNK)
        pseudo = np.concatenate([self._find_pseudonormals(face[own], place[own]) for own in some])
        outside = np.einsum("ij,ij->i", points - place, pseudo) >= 0
        return np.where(outside, 1.0, -1.0) * np.sqrt(np.ravel(squared)), face, place, pseudo

    def _find_pseudonormals(self, face: Ints, place: Floats) -> Floats:
        """The pseudonormals (N,3) at places (N,3) on faces (N,): of the face, of an edge or of a vertex."""
        of_face, of_vertex, of_edge, opposite = self._normals
        a, b, c = (self.vertices[self.faces[face, k]] for k in range(3))
        u, v, w = b - a, c - a, place - a
        uu, uv, vv, wu, wv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (u, v), (v, v), (w, u), (w, v)))
        scale = uu * vv - uv * uv
        sound = scale > 0  # slivers lose their area by cancellation: their own normal is taken
        scale[~sound] = 1.0
        second, third = (vv * wu - uv * wv) / scale, (uu * wv - uv * wu) / scale
        share = np.stack([1 - second - third, second, third], axis=1)
        share[~sound] = 1 / 3
        low = share <= ON_EDGE
        number = low.sum(axis=1)
        found = of_face[face]
        on_edge, on_vertex = np.flatnonzero(number == 1), np.flatnonzero(number >= 2)
        found[on_edge] = of_edge[opposite[face[on_edge], low[on_edge].argmax(axis=1)]]
        found[on_vertex] = of_vertex[self.faces[face[on_vertex], share[on_vertex].argmax(axis=1)]]
        return np.asarray(found)


def keep_signed_mesh(mesh: Mesh, vertices: Floats, faces: Ints, find_tree: Callable[[], Tree]) -> SignedMesh:
    """The prepared mesh, from the last call or made now. ``vertices``, ``faces``, what ``find_tree`` gives: as of
    `SignedMesh`."""
    if (found := _last.get(mesh)) is None:
        _last.clear()
        found = _last[mesh] = SignedMesh(vertices, faces, find_tree(), mesh.faces)
    return found
