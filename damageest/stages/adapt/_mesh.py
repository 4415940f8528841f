"""The deformed part: its mesh, the rigid motion in the field, and whether it is still a solid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from damageest.artefacts import ArtefactError, Floats, Part
from damageest.errors import StageError
from damageest.geometry.refinement import cut_part
from damageest.stages.adapt._field import Field

FOLLOWS = 0.1
"""How far the deformed triangles may lie from the deformed skin, in tolerances."""
FINEST = 150.0
"""Edges along the part's diagonal that its triangles are never shorter than."""
STEEPEST = 0.8
"""Largest change of the displacement per length. Below 1 on the way between two places, they do not meet: the deformed
part has no self-intersection that the part as designed does not have."""
REMEDY = "adapt: none; or crop other objects from the scan"


def refine(part: Part, centre: Floats, tolerance: float, *fields: Field) -> tuple[Part, float]:
    """The part as designed with triangles that follow the fields, one after the other, and by how much they may not."""
    sharp = sum(bound_curvature(field, part.vertices - centre) for field in fields)
    edge = float(np.sqrt(8 * FOLLOWS * tolerance / max(sharp, 1e-300)))
    edge = max(edge, part.diagonal / FINEST)
    return cut_part(part, edge), min(edge, part.diagonal) ** 2 * sharp / 8


def bound_curvature(field: Field, places: Floats) -> float:
    """The largest second derivative of the displacement over the box of places (N,3)."""
    at = _fill_box(places, 9)
    second = np.einsum("nms,mk->nsk", field.basis.bound_curvature(at), field.coefficients)
    double = np.array([1, 1, 1, 2, 2, 2])[None, :, None]
    return float(np.sqrt((double * second**2).sum(axis=(1, 2))).max())


def require_injective(field: Field, turn: Floats, places: Floats, largest: float) -> None:
    """Raises StageError where the field folds the metal, or may bring two places together.

    ``places`` (N,3): all over the skin; ``largest``: the largest displacement. Two places of the metal between which
    the way leads farther from it than that cannot meet; the way between all others goes through where the slope is
    asked for.
    """
    from scipy.spatial import cKDTree

    box = _fill_box(places, 16)
    step = float(np.linalg.norm(np.ptp(places, axis=0))) / 15
    at = np.concatenate([places, box[cKDTree(places).query(box)[0] < largest + step]])
    gradient = np.einsum("ka,nkb->nab", turn, field.differentiate(at))
    steep = float(np.linalg.norm(gradient - np.eye(3), ord=2, axis=(1, 2)).max())
    if steep > STEEPEST or float(np.linalg.det(gradient).min()) <= 0:
        raise StageError(
            f"the deformation that fits the scan would fold the part: gradient {steep:.2f}, safe up to {STEEPEST:g}",
            REMEDY,
        )


def deform_part(part: Part, moved: Floats, error: float) -> Part:
    """The part with its vertices moved. Raises StageError where it is no solid."""
    try:
        return replace(part, vertices=moved, tessellation_error=part.tessellation_error + error)
    except ArtefactError as problem:
        raise StageError(f"the deformed part is no solid: {problem}", REMEDY) from None


def _fill_box(places: Floats, count: int) -> Floats:
    """An even grid of places over the box of others."""
    low, high = places.min(axis=0), places.max(axis=0)
    axes = [np.linspace(a, b, count) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
