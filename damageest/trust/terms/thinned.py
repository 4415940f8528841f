"""What the field of an adapted part made thinner: wear may have done it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import AdaptedPart, Solid
from damageest.geometry.distance import distance_to_mesh
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term

BESIDE = 10.0
"""Distance from a damage volume, in tolerances, up to which what a field made thinner may be the same wear."""


class Thinned(Term):
    name = "thinned"
    text = "adaptation that makes the part thinner"
    type = "B"
    remedy = "give a datum, or a second part of its type"
    bound = "form"
    rank = 240

    def measure(self, case: LossCase) -> Share | None:
        return Share(high=measure_lowered(case.adapted, case.loss.damage, BESIDE * case.tolerance))


def measure_lowered(adapted: AdaptedPart | None, damage: Solid, reach: float) -> float:
    """Volume that the field of an adapted part took off beneath a damage volume and within ``reach`` of it, where a
    field that hardly strains the metal leaves it: wear would look the same."""
    if adapted is None or adapted.lowered is None or not adapted.lowered.any():
        return 0.0
    part = adapted.part
    depth = adapted.lowered[part.faces].mean(axis=1)
    some = np.flatnonzero(depth > 0)
    centres = part.triangles[some].mean(axis=1)
    near = ((centres > damage.bounds[0] - reach) & (centres < damage.bounds[1] + reach)).all(axis=1)
    some, centres = some[near], centres[near]
    if not len(some):
        return 0.0
    own = some[distance_to_mesh(centres, damage) < reach]
    return float(depth[own] @ part.face_areas[own])
