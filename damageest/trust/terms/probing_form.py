"""The probing form error of the scanner, beyond the noise."""

from __future__ import annotations

import numpy as np

from damageest.trust.interval.loss import LossCase
from damageest.trust.interval.scanner import Figure
from damageest.trust.interval.site_error import Share, Term


class ProbingForm(Term):
    name = "probing_form"
    text = "probing form error beyond the noise and the form that the scan shows"
    type = "B"
    rank = 100
    is_own = True
    is_of_surface = True

    def measure(self, case: LossCase) -> Share | None:
        form, pose = case.errors.scanner.form, case.errors.pose
        if not form:
            return None
        # what were common to more than a patch would show in the patches of intact skin
        patches = max(1.0, case.exposed / max(pose.patch_area, 1e-300))
        figure = Figure(self.name, form, case.errors.facts.unit, 1.0, "normal")
        return Share(float(form * case.exposed / np.sqrt(patches)), form, figure=figure)
