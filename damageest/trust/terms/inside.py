"""The inner surface without points: the loss may be deeper behind it."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term

HOLE = 0.5
"""Depth that a hole in the scan of an inner surface may hide, in square roots of its area."""


class Inside(Term):
    name = "inside"
    text = "inner surface without points"
    type = "B"
    remedy = "scan into the damage from another side"
    rank = 220

    def measure(self, case: LossCase) -> Share | None:
        return Share(high=HOLE * case.hole**1.5 + case.loss.beyond.short)
