"""The pose, as far as intact skin fixes it."""

from __future__ import annotations

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.site_error import Share, Term


class Pose(Term):
    name = "pose"
    text = "pose, fitted to the intact points"
    type = "A"
    words = "pose"
    remedy = "scan more intact skin, or name unworn faces in align.datum"
    rank = 40

    def measure(self, case: LossCase) -> Share | None:
        pose, deepest = case.errors.pose, case.deepest
        return Share(pose.of_volume(*case.places), pose.of_distance(deepest.at, deepest.normal))
