"""The inner surface that was closed across what the scan does not show: the loss may end before it."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class Closed(Term):
    name = "closed"
    text = "inner surface closed across unseen places"
    type = "B"
    remedy = "scan into the damage from another side"
    rank = 210

    def measure(self, case: LossCase) -> Share | None:
        evidence, volume = case.loss.evidence, case.loss.damage.volume
        open_ = volume * evidence.ids_unseen if case.hole else 0.0
        # a dent in a thin wall has lost nothing
        return Share(low=open_ + (volume if case.bent_wall else 0.0))
