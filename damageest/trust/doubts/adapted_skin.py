"""A loss on an adapted part that is hardly deeper than what the adapted part leaves of the form."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

MOVED = 1.0
"""Tolerances that the part has to be adapted by, for the rule to be asked."""
SHALLOW = 1.3
"""Depth, in tolerances, up to which a loss may be what the field did not follow."""


class AdaptedSkin(Rule):
    code = "adapted_skin"
    meaning = "the loss on an adapted part is hardly deeper than the tolerance: the field may miss form there"
    threshold = (
        f"on a part adapted by {MOVED:g} tolerance or more, 95% of its points are not deeper than "
        f"{SHALLOW:g} tolerances"
    )
    remedy = "a larger tolerance, or a second part of its type (adapt.prior)"
    topic = "form"
    rank = 40

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if scan.adapted < MOVED * scan.tolerance or site.deepest > SHALLOW * scan.tolerance:
            return
        text = (
            f"only {site.deepest:.3g} {scan.unit} deep, on a part that was deformed by up to "
            f"{scan.adapted:.3g} {scan.unit}: the field may miss form here"
        )
        yield Reason(self.code, text, "contradicts", site.deepest, scan.unit, remedy=self.remedy)
