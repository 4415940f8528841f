"""The interval of the volume reaches down to nearly nothing."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

NOTHING = 0.2
"""Low end of the interval, as a share of the volume, up to which a site may be no loss. Tried at this value alone, in a
simulation on 498 groups of sites of 183 troubled scans."""


class Nothing(Rule):
    code = "nothing"
    meaning = "the interval of the volume reaches down to nearly nothing: the site may be no loss"
    threshold = f"low end at most {NOTHING:.0%} of the volume, or no interval"
    remedy = "see what makes its interval wide"

    def ask(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.interval is None:
            yield Reason(self.code, "no scan points lie on its inner surface, and its volume has no interval", "widens")
        elif site.interval[0] <= NOTHING * site.volume:
            low, high = site.interval
            text = f"its volume is {low:.3g} to {high:.3g} {scan.unit}³: errors of scan, pose and form may explain it"
            yield Reason(self.code, text, "widens", low, f"{scan.unit}³")
