"""The field that deforms an adapted part, as far as intact skin fixes it."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class Adapt(Term):
    name = "adapt"
    text = "adaptation of the part"
    type = "A"
    words = "adaptation of the part"
    remedy = "scan more intact skin beside it, or give a datum or a second part of its type"
    rank = 50

    def measure(self, case: LossCase) -> Share | None:
        adapted, (volume, depth) = case.adapted, case.bent
        if adapted is None:
            return None
        # what another field makes of the volume moves its ends
        return Share(volume if adapted.other is None else volume[:-1], depth)
