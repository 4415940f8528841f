"""Overlapping views that disagree."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import WIDTH, Share, Term


class Views(Term):
    name = "views"
    text = "disagreement of overlapping views"
    type = "A"
    words = "disagreeing views"
    remedy = "register the views again"
    rank = 80

    def measure(self, case: LossCase) -> Share | None:
        return Share(case.errors.facts.between_views * case.exposed / WIDTH)
