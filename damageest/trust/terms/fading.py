"""A shallow loss that fades out beyond its rim."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class Fading(Term):
    name = "fading"
    text = "loss that fades out beyond the rim"
    type = "B"
    remedy = "choose the depth that counts: a smaller tolerance includes more"
    rank = 250

    def measure(self, case: LossCase) -> Share | None:
        return None if case.fading is None else Share(high=case.fading.beyond)
