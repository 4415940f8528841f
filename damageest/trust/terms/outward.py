"""Skin that lies as far outside the part: the loss may come from the same error."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import WIDTH, Share, Term

OUTWARD = 0.3
"""Share of a site's area that skin which lies outside by some tolerances has to have, to be the sign of one error: no
damage puts skin outside."""


class Outward(Term):
    name = "outward"
    text = "skin as far outside the part"
    type = "B"
    words = "skin as far outside the part"
    remedy = "check pose and scale of the scan"
    rank = 70

    def measure(self, case: LossCase) -> Share | None:
        facts = case.errors.facts
        is_sign = facts.outward_area > OUTWARD * case.skin_area
        return Share((facts.outward_height if is_sign else 0.0) * case.exposed / WIDTH)
