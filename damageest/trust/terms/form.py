"""Intact skin that deviates over whole areas."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term

AVERAGED = 0.01
"""Standard deviation of the inner surface, in tolerances, that all of it has in common: averaged points lie a little
below skin that curves. Worn journals came out by 0.02 tolerances too deep all over."""


class Form(Term):
    name = "form"
    text = "intact skin that deviates over whole areas"
    type = "A"
    words = "deviating intact skin"
    remedy = "check whether the part is bent, or the scan scaled"
    rank = 60

    def measure(self, case: LossCase) -> Share | None:
        centres, _, areas = case.places
        common = case.errors.pose.measure_common(centres, areas)
        # a form that a fit gives is common to the whole site; that of patches as far as they deviate alike
        off = max(case.form, case.deviation * common, AVERAGED * case.tolerance)
        return Share(float(off * case.exposed), max(case.form, case.deviation))
