"""Surplus lies on the skin of the site."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class Covered(Rule):
    code = "covered"
    meaning = "surplus covers the skin of the site: a loss below it cannot be seen"
    threshold = "points of the surplus within two tolerances, or 1.5 spacings, of the site's points"
    remedy = "remove the surplus (weld bead, dirt) and scan again"
    topic = "surplus"
    rank = 190

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        for number, area in site.covered:
            text = f"surplus {number} covers its skin: a loss below it cannot be seen"
            yield Reason(self.code, text, "open", area * site.deepest, f"{scan.unit}³", remedy=self.remedy)
