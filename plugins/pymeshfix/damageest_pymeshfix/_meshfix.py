"""MeshFix on one shell at a time: on several it keeps only the largest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Solid
from damageest.geometry.body_repair import label_bodies
from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import concatenate_meshes, to_manifold, unite


def split_open_shells(mesh: Mesh) -> list[Mesh]:
    """The pieces of a mesh, closed or not, largest area first.

    Triangles are in one piece where they share an edge that no third triangle has. Vertices in the same place count as
    one.
    """
    _, first, same = np.unique(mesh.vertices, axis=0, return_index=True, return_inverse=True)
    faces = first[same.reshape(-1)][mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        return []
    label, count = label_bodies(faces)
    pieces = [drop_unused_vertices(mesh.vertices, faces[label == k]) for k in range(count)]
    return sorted(pieces, key=lambda piece: -piece.area)


def close_shells(pieces: Sequence[Mesh]) -> Solid | None:
    """One closed mesh of several pieces by MeshFix, normals outward; None where MeshFix cannot close them."""
    from pymeshfix import PyTMesh

    vertices, faces, _ = concatenate_meshes(pieces)
    fixer = PyTMesh()
    fixer.set_quiet(1)
    try:
        fixer.load_array(np.array(vertices, order="C"), np.array(faces, dtype=np.int32, order="C"))
        if len(pieces) > 1:
            fixer.join_closest_components()
        fixer.fill_small_boundaries(0, True)
        fixer.clean(10, 3)
        vertices, faces = fixer.return_arrays()
    except RuntimeError:
        return None
    faces = np.asarray(faces, np.int64)
    for oriented in (faces, faces[:, ::-1]):
        try:
            return Solid(np.asarray(vertices, np.float64), oriented)
        except ValueError:
            continue
    return None


def combine_solids(solids: Sequence[Solid]) -> Any:
    """The solids as one manifold3d.Manifold. A solid inside an odd number of others bounds a cavity."""
    depth = [sum(_is_inside(solid.vertices, other) for other in solids if other is not solid) for solid in solids]
    body = unite([solid for solid, level in zip(solids, depth, strict=True) if not level])
    for level in range(1, max(depth) + 1):
        for solid in (s for s, d in zip(solids, depth, strict=True) if d == level):
            body = body - to_manifold(solid) if level % 2 else body + to_manifold(solid)
    return body


def _is_inside(points: Floats, solid: Solid) -> bool:
    """Whether all points (N,3) lie inside a solid."""
    return bool((signed_distance(points, solid)[0] < 0).all())


def drop_unused_vertices(vertices: Floats, faces: Ints) -> Mesh:
    """A mesh of these faces (F,3), with only the vertices (V,3) that they use."""
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3))
