"""A small site among large ones that the scan contradicts."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

MANY, SHARE = 4, 0.9
"""Number of contradicted sites, and their share of the volume that was found, from which the scan itself is in doubt.
A coupling with points between its edges and what lies behind them had nine such sites of ten, and 99 % of the volume;
the tenth was a loss that is none. A true loss beside small false ones holds most of the volume."""


class DoubtedScan(Rule):
    code = "doubted_scan"
    meaning = "most of what was found is contradicted: what is wrong there may be wrong here"
    threshold = f"{MANY} other sites are contradicted, which hold {SHARE:.0%} of the volume that was found"
    remedy = "look at the contradicted sites first, or accept this one by its number"
    rank = 210

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.contradicted >= MANY and site.contradicted_share >= SHARE:
            text = (
                f"{site.contradicted} other sites, {site.contradicted_share:.0%} of the volume found, are contradicted"
            )
            yield Reason(self.code, text, "contradicts", site.contradicted_share, remedy=self.remedy)
