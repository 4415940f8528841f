"""The numbers of CAD faces on triangles that a repair has divided."""

from __future__ import annotations

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.distance import closest_on_mesh

NEAR = 1e-7
"""Largest distance of a triangle's centre from the triangles before, in their diagonals."""


def carry_labels(vertices: Floats, faces: Ints, before: Mesh, label: Ints) -> Ints | None:
    """(F,) the label of each triangle of a mesh whose triangles lie on those of ``before``, which have a ``label``
    (G,). None where one of them does not lie there, for example in a closed hole."""
    distance, nearest, _ = closest_on_mesh(vertices[faces].mean(axis=1), before)
    return label[nearest] if bool((distance <= NEAR * before.diagonal).all()) else None
