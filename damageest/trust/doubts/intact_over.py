"""Intact points lie as densely on the removed skin as on other skin, rim included."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

UNCLEAR, AGAINST, AGAINST_IF_DEEP = 0.3, 0.8, 0.5
"""Share of the removed skin with intact points from which the rim is not clear, and from which they contradict the
site; the third for a deep one. On 183 troubled scans, 0.5 doubted chips two tolerances deep that were right: a quarter
of their skin is shallower than half a tolerance. Shrunk parts and cracks have 0.8 and more, and 16 stray points 4.5
tolerances below intact skin 0.6."""
DEEP = 3.0
"""Depth in tolerances of half of a site's points from which little of its skin can be that shallow."""


class IntactOver(Rule):
    code = "intact_over"
    meaning = "intact scan points lie on the skin that the damage volume removes as densely as elsewhere, rim included"
    threshold = (
        f"on {UNCLEAR:.0%} of it the rim is not clear; on {AGAINST:.0%} they contradict the site, on "
        f"{AGAINST_IF_DEEP:.0%} where it is deeper than {DEEP:g} tolerances"
    )
    remedy = "a smaller tolerance, if the noise allows it, or a denser scan"
    topic = "doubtful"
    rank = 130

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        share = site.evidence.intact_share
        if site.by_rays or share <= UNCLEAR:
            return
        text = f"intact points lie on {share:.0%} of the removed skin"
        if share > (AGAINST_IF_DEEP if site.typical > DEEP * scan.tolerance else AGAINST):
            yield Reason(self.code, text, "contradicts", share, remedy=self.remedy)
        else:
            yield Reason(self.code, f"{text}: the rim is unclear", "open", share, remedy=self.remedy)
