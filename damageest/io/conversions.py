"""Conversions of meshes to objects of trimesh and manifold3d."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.solids import to_manifold
from damageest.geometry.transforms import move_mesh


def as_trimesh(mesh: Mesh, T: Floats | None = None) -> Any:
    """A ``trimesh.Trimesh`` with a copy of the mesh, moved by T (4,4). Vertices are not merged or reordered."""
    from trimesh import Trimesh

    return Trimesh(np.array(move_mesh(mesh, T).vertices), np.array(mesh.faces), process=False)


def as_manifold(solid: Solid, T: Floats | None = None) -> Any:
    """A ``manifold3d.Manifold`` of the solid, moved by T (4,4)."""
    return to_manifold(move_mesh(solid, T))
