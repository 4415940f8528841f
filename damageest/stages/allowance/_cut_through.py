"""Whether a cavity that is cut back or opened comes out on the other side of a wall."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Mesh, Part, Solid
from damageest.geometry.bodies import label_pieces
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.skin import find_inner_faces

LEAST = 2.0
"""Width, in tolerances, of the square whose area the skin on the other side has at least."""


def describe_cut_through(damage: Solid, cavity: Solid, part: Part, tolerance: float) -> list[str]:
    """What to say where the ``cavity`` takes skin away that the ``damage`` leaves, apart from the skin around it: how
    much metal was left under the damage there."""
    outer = np.flatnonzero(~find_inner_faces(cavity, part))
    lost = damage.faces[~find_inner_faces(damage, part)]
    if not len(outer) or not len(lost):
        return []
    piece = label_pieces(cavity.faces[outer])
    middle = cavity.triangles[outer].mean(axis=1)
    beside = distance_to_mesh(middle, Mesh(damage.vertices, lost)) <= tolerance
    area = cavity.face_areas[outer]
    told = []
    for number in np.unique(piece):
        own = piece == number
        if beside[own].any() or area[own].sum() < (LEAST * tolerance) ** 2:
            continue
        gap = distance_to_mesh(middle[own], damage)
        if float(gap.min()) <= tolerance / 4:
            continue  # the damage comes out there itself
        near = ", ".join(f"{value:.4g}" for value in middle[own][int(gap.argmin())])
        told.append(
            f"the cavity cuts through a wall near ({near}): {gap.min():.3g} {part.unit} of metal are left under the "
            f"damage, and {area[own].sum():.3g} {part.unit}² of skin on the other side are removed; use less inner or "
            "prepare.depth"
        )
    return told
