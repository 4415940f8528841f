"""The volume holds more than the scan points on its surface show."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Effect, Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

ASKED, CONTRADICTED = 0.01, 0.03
"""Share of the volume that no point shows, above which it is reported, and above which it contradicts the volume.
Measured with points 2.5 to 5 tolerances apart: true volumes (pits, an edge, a narrow hole, a worn bore, a pocket half a
gap deep) have at most 0.007; a pocket found 27 % too large has 0.035. What is too large beside the rim does not show
here: a pocket found 13 % too large, mostly beside its rim, has 0.005."""


class BeyondPointsRule(Rule):
    code = "beyond_points"
    meaning = "the volume bulges between or beyond the scan points on its surface"
    threshold = f"{ASKED:.0%} of the volume is reported; more than {CONTRADICTED:.0%} contradicts it"
    remedy = "scan this place more densely"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.by_rays or site.beyond <= ASKED * site.volume:
            return
        is_against = site.beyond > CONTRADICTED * site.volume
        effect: Effect = "contradicts" if is_against else "open"
        yield Reason(self.code, site.beyond_words, effect, site.beyond, f"{scan.unit}³", remedy=self.remedy)
