"""MeshFix on one shell at a time: left to itself it keeps the largest and drops the others."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Solid
from damageest.geometry.distance import signed_distance


def shells(mesh: Mesh) -> list[Mesh]:
    """The pieces whose triangles hang together by edges that two of them share, largest area first.

    Corners in the same place count as one. Where three or more triangles meet at an edge, pieces part there.
    """
    import trimesh

    _, first, same = np.unique(mesh.vertices, axis=0, return_index=True, return_inverse=True)
    faces = first[same.reshape(-1)][mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if not len(faces):
        return []
    pairs = trimesh.graph.face_adjacency(faces)
    label = trimesh.graph.connected_component_labels(pairs, node_count=len(faces))
    pieces = [trimmed(mesh.vertices, faces[label == k]) for k in range(int(label.max()) + 1)]
    return sorted(pieces, key=lambda piece: -piece.area)


def closed(pieces: Sequence[Mesh]) -> Solid | None:
    """MeshFix's closed mesh of pieces that belong together, normals outward; None where none comes about."""
    from pymeshfix import PyTMesh

    starts = np.cumsum([0, *(len(piece.vertices) for piece in pieces)])
    vertices = np.concatenate([piece.vertices for piece in pieces])
    faces = np.concatenate([piece.faces + start for piece, start in zip(pieces, starts, strict=False)])
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
    for wound in (faces, faces[:, ::-1]):
        try:
            return Solid(np.asarray(vertices, np.float64), wound)
        except ValueError:
            continue
    return None


def assembled(solids: Sequence[Solid]) -> Any:
    """The solids as one manifold3d.Manifold. One inside an odd number of others bounds a cavity."""
    from damageest.geometry.solids import to_manifold, unite

    depth = [sum(_inside(solid.vertices, other) for other in solids if other is not solid) for solid in solids]
    body = unite([solid for solid, level in zip(solids, depth, strict=True) if not level])
    for level in range(1, max(depth) + 1):
        for solid in (s for s, d in zip(solids, depth, strict=True) if d == level):
            body = body - to_manifold(solid) if level % 2 else body + to_manifold(solid)
    return body


def _inside(points: Floats, solid: Solid) -> bool:
    return bool((signed_distance(points, solid)[0] < 0).all())


def trimmed(vertices: Floats, faces: Ints) -> Mesh:
    """A mesh of these faces, with the vertices that they use."""
    used, faces = np.unique(faces, return_inverse=True)
    return Mesh(vertices[used], faces.reshape(-1, 3))
