"""Pieces of a mesh that are no bodies: what rounding, or two bodies with other triangles on one surface, leave."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.bodies import ROUNDING, label_pieces

SPECK = 1e-12
"""Volume of a piece, in volumes of the bounds of all, below which it is a rounding error."""
GAP = 1e-5
"""Thickness of a cavity, in diagonals of all, below which it is the gap between two triangulations of one surface."""


def find_slivers(vertices: Floats, faces: Ints, gap: float = 0.0) -> Flags:
    """(F,) the faces of pieces without thickness, and of cavities thinner than ``gap`` or GAP.

    Args:
        vertices, faces: (V,3), (F,3) of a closed mesh; its pieces share no vertex.
        gap: how far the triangles may lie off the surface that they stand for, in the vertices' unit.

    The thickness of a piece is twice its volume over its area, which is that of a thin plate. All is in the unit of
    ``vertices``.
    """
    if not len(faces):
        return np.zeros(0, bool)
    label = label_pieces(faces)
    size = np.ptp(vertices[np.unique(faces)], axis=0)
    a, b, c = np.moveaxis((vertices - vertices[faces[0, 0]])[faces], 1, 0)
    normal = np.cross(b - a, c - a)
    # about a vertex of its own: far from it, a small piece has no digits left
    first = a[np.unique(label, return_index=True)[1]][label]
    volume = np.bincount(label, np.einsum("ij,ij->i", a - first, normal) / 6)
    area = np.bincount(label, np.linalg.norm(normal, axis=1) / 2)
    diagonal = float(np.linalg.norm(size))
    thickness = 2 * np.abs(volume) / np.maximum(area, 1e-300)
    sliver = (thickness <= ROUNDING * diagonal) | (np.abs(volume) <= SPECK * np.prod(size))
    sliver |= (volume < 0) & (thickness <= max(gap, GAP * diagonal))
    return np.asarray(sliver[label])
