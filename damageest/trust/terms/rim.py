"""Where the inner surface meets the skin: points less deep than the tolerance may be intact skin."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class Rim(Term):
    name = "rim"
    text = "where the inner surface meets the skin, calibrated on simulated damages"
    type = "B"
    words = "rim"
    remedy = "a smaller tolerance, if the noise allows it"
    rank = 30
    is_of_surface = True

    def measure(self, case: LossCase) -> Share | None:
        surface = case.surface
        return None if surface is None else Share(surface.rim)
