"""The noise of the points on the inner surface."""

from __future__ import annotations

import numpy as np

from damageest.trust.interval.inner_surface import DEPTH_NOISE
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term

POINT_GAP = 1.1
"""Spacing of points in square roots of the area that each stands for, as `measure_noise_and_spacing` gives it."""


class Noise(Term):
    name = "noise"
    text = "noise of the points on the inner surface"
    type = "A"
    words = "noise"
    remedy = "scan with less noise, or several times"
    rank = 10
    is_own = True
    is_of_surface = True
    is_of_points = False

    def measure(self, case: LossCase) -> Share | None:
        surface, aligned, part = case.surface, case.field.aligned, case.field.part
        if surface is None:
            return None
        # of skin that is the mean of the points of an earlier scan, each of which stands for an area
        of_skin = part.scan_noise * float(np.sqrt(case.skin_area)) * part.scan_spacing / POINT_GAP
        depth = DEPTH_NOISE * float(np.hypot(aligned.noise, part.scan_noise))
        return Share(float(np.hypot(surface.noise, of_skin)), depth, aligned.noise)
