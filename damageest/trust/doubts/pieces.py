"""A site that is deep in one place, and at the limit of what the scan tells in another."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts
from damageest.trust.doubts.nothing import is_nothing

APRON, UNEVEN = 0.5, 1.5
"""Low end, as a share of the volume, up to which the rest is told apart; and by how much deeper the deepest points of
such a site are than half of them."""


class Pieces(Rule):
    code = "pieces"
    meaning = "a piece of the site is certain, the shallow rest around it is not"
    threshold = f"low end at most {APRON:.0%} of the volume, and 5 % of its points {UNEVEN:g} times deeper than half"
    remedy = "a larger tolerance keeps the certain piece alone"
    rank = 20

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        certain = site.uncertainty.certain if site.uncertainty else 0.0
        if site.interval is None or is_nothing(site.volume, site.interval, certain):
            return
        low = site.interval[0]
        if low > APRON * site.volume or site.deepest < UNEVEN * site.typical:
            return
        more = site.volume - low
        text = f"{low:.3g} {scan.unit}³ are certain, up to {more:.3g} more in its shallow part"
        yield Reason(self.code, text, "widens", more, f"{scan.unit}³", remedy=self.remedy)
