"""Solids to manifold3d and back in float64, moved near the origin on the way so that far coordinates cost no digits."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from damageest.artefacts import Floats, Ints, Mesh


def to_manifold(mesh: Mesh, origin: ArrayLike = (0.0, 0.0, 0.0)) -> Any:
    """A ``manifold3d.Manifold`` of a watertight mesh, its coordinates relative to ``origin``.

    Raises ValueError where manifold3d does not take the mesh for a closed, oriented one.
    """
    from manifold3d import Error, Manifold, Mesh64

    vertices = np.array(mesh.vertices - np.asarray(origin, dtype=np.float64), dtype=np.float64, order="C")
    body = Manifold(Mesh64(vertices, np.array(mesh.faces, dtype=np.uint64, order="C")))
    if body.status() != Error.NoError:
        raise ValueError(f"manifold3d refuses the mesh: {body.status().name}")
    return body


def to_arrays(body: Any, origin: ArrayLike = (0.0, 0.0, 0.0)) -> tuple[Floats, Ints]:
    """Vertices (V,3) and faces (F,3) of a Manifold, moved by ``origin``."""
    mesh = body.to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=np.float64)[:, :3] + np.asarray(origin, dtype=np.float64)
    return vertices, np.asarray(mesh.tri_verts).astype(np.int64)
