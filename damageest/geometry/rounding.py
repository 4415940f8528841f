"""Solids whose coordinates fit into single precision."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Mesh, Solid, open_edges
from damageest.geometry.duplicates import find_duplicates
from damageest.geometry.solids import to_arrays, to_manifold


def round_to_single(solid: Solid, mend: bool = True) -> Solid | None:
    """The solid with coordinates that single precision holds, watertight even where equal vertices count as one.

    Rounding can bring vertices together: the triangles that vanish are taken out. Where that opens the mesh, its
    smallest details are collapsed first, up to 64 times the rounding, if it is to ``mend``. None where even then it
    does not close.
    """
    for steps in (0, 2, 8, 64) if mend else (0,):
        mesh: Mesh = solid
        if steps:
            mesh = _simplified(solid, steps * float(np.spacing(np.float32(np.abs(solid.vertices).max()))))
        rounded = mesh.vertices.astype(np.float32).astype(np.float64)
        keep, inverse = find_duplicates(rounded)
        faces = inverse[mesh.faces]
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
        if len(faces) and not open_edges(faces):
            try:
                return Solid(rounded[keep], faces)
            except ValueError:  # nothing but rounding is left of its volume
                return None
    return None


def _simplified(solid: Solid, size: float) -> Mesh:
    """The solid without details below ``size``."""
    origin = solid.bounds.mean(0)
    try:
        return Mesh(*to_arrays(to_manifold(solid, origin).simplify(size), origin))
    except ValueError:
        return solid
