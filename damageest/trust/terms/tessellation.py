"""The triangles of the part, or of an earlier scan, in place of its curved surface."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Solid
from damageest.geometry.edges import pair_faces
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term

FLAT, SMOOTH = 0.05, 30.0
"""Angles in degrees between triangles that are chords of one curved face."""


class Tessellation(Term):
    name = "tessellation"
    text = "tessellation of the CAD surface"
    type = "B"
    distribution = "rectangular"
    words = "triangles of part or earlier scan"
    remedy = "a finer part.chord, or a denser earlier scan"
    rank = 90

    def measure(self, case: LossCase) -> Share | None:
        bound = case.field.part.tessellation_error
        curved = _measure_curved(case.loss.damage, case.skin, case.loss.damage.face_areas) if bound else 0.0
        return Share(float(bound * curved / np.sqrt(3)), bound / 3**0.5, bound / 3**0.5)


def _measure_curved(damage: Solid, skin: Flags, area: Floats) -> float:
    """Area of the removed skin that is curved: triangles beside others that turn by a small angle. Chords err there."""
    _, _, first, second = pair_faces(damage.faces)
    between = skin[first] & skin[second]
    first, second = first[between], second[between]
    cosine = np.einsum("ij,ij->i", damage.face_normals[first], damage.face_normals[second])
    turns = (cosine < np.cos(np.radians(FLAT))) & (cosine > np.cos(np.radians(SMOOTH)))
    curved = np.zeros(len(area), bool)
    curved[first[turns]] = True
    curved[second[turns]] = True
    return float(area[curved].sum())
