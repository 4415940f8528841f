"""Solids with coordinates in single precision, as binary STL files store them."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Mesh, Solid, open_edges
from damageest.geometry.duplicates import find_duplicates
from damageest.geometry.solids import to_arrays, to_manifold


def round_to_single(solid: Solid, mend: bool = True) -> Solid | None:
    """The solid with its coordinates rounded to single precision, and equal vertices merged; watertight.

    Rounding can move vertices to one place; triangles that lose their area by it are removed. If this opens the mesh,
    its smallest details are collapsed before rounding, up to 64 times the rounding step, unless ``mend`` is False. The
    coordinates given back are float64 numbers that are equal in single precision. Unit and frame stay.

    None where the mesh cannot be closed, or has no volume left.
    """
    for steps in (0, 2, 8, 64) if mend else (0,):
        mesh: Mesh = solid
        if steps:
            mesh = _simplify(solid, steps * float(np.spacing(np.float32(np.abs(solid.vertices).max()))))
        rounded = mesh.vertices.astype(np.float32).astype(np.float64)
        keep, inverse = find_duplicates(rounded)
        faces = inverse[mesh.faces]
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
        if len(faces) and not open_edges(faces):
            try:
                return Solid(rounded[keep], faces)
            except ValueError:  # its volume is no more than the rounding
                return None
    return None


def _simplify(solid: Solid, size: float) -> Mesh:
    """The solid without details smaller than ``size``; the same where manifold3d rejects it."""
    origin = solid.bounds.mean(0)
    try:
        return Mesh(*to_arrays(to_manifold(solid, origin).simplify(size), origin))
    except ValueError:
        return solid
