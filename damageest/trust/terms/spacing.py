"""The surface between the points."""

from __future__ import annotations

from damageest.trust.interval.inner_surface import DEPTH_GAP
from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class Spacing(Term):
    name = "spacing"
    text = "surface between the points, calibrated on simulated damages"
    type = "B"
    words = "gaps between the points"
    remedy = "scan this place more densely"
    rank = 20
    is_of_surface = True
    is_of_points = False

    def measure(self, case: LossCase) -> Share | None:
        surface = case.surface
        return None if surface is None else Share(surface.spacing, DEPTH_GAP * surface.gap)
