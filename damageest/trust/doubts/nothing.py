"""The interval of the volume reaches down to nearly nothing."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.findings import Interval
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

NOTHING = 0.2
"""Low end of the interval, as a share of the volume, up to which a site may be no loss. Tried at this value alone, in a
simulation on 498 groups of sites of 183 troubled scans."""


CERTAIN = 0.1
"""Share of the volume of the piece that is lost in any case, from which a site is a loss: deep in one place, though at
the limit of what the scan tells in another."""


def is_nothing(volume: float, interval: Interval, certain: float) -> bool:
    """Whether a site may be no loss: its interval reaches down to nearly nothing, and no piece of it is certain."""
    return interval[0] <= NOTHING * volume and certain <= CERTAIN * volume


class Nothing(Rule):
    code = "nothing"
    meaning = "the interval nearly reaches 0: the site may be no loss"
    threshold = (
        f"low end at most {NOTHING:.0%} of the volume, and no piece of {CERTAIN:.0%} of it lost in any case; or no "
        "interval"
    )
    remedy = "scan this place again, or look at the part: accept the site or drop it"
    topic = "doubtful"
    rank = 10

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.interval is None:
            yield Reason(self.code, "no scan points on its inner surface, so no interval", "widens", remedy=self.remedy)
        elif is_nothing(site.volume, site.interval, site.uncertainty.certain if site.uncertainty else 0.0):
            low, high = site.interval
            text = f"its volume is {low:.3g} to {high:.3g} {scan.unit}³: errors of scan, pose or form may explain it"
            yield Reason(self.code, text, "widens", low, f"{scan.unit}³", remedy=self.remedy)
