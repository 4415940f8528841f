"""The volume holds more than the scan points on its surface show."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Effect, Reason
from damageest.trust.beyond_points import ASKED, CONTRADICTED
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class BeyondPointsRule(Rule):
    code = "beyond_points"
    meaning = "the volume bulges between or beyond the scan points on its surface"
    threshold = f"{ASKED:.0%} of the volume is reported; more than {CONTRADICTED:.0%} contradicts it"
    remedy = "scan this place more densely"
    topic = "sparse"
    rank = 150

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.by_rays or site.beyond <= ASKED * site.volume:
            return
        is_against = site.beyond > CONTRADICTED * site.volume
        effect: Effect = "contradicts" if is_against else "open"
        yield Reason(self.code, site.beyond_words, effect, site.beyond, f"{scan.unit}³", site.beyond_at, self.remedy)
