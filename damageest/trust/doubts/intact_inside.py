"""Intact points lie on the skin that the damage volume removes, away from its rim."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class IntactInside(Rule):
    code = "intact_inside"
    meaning = "intact scan points lie on the skin that the damage volume removes, away from its rim"
    threshold = "more than 10 points and 2 % of the site's points, or on more than a tenth of that skin"
    remedy = "look at the site in the report: it may join two losses, or a second sheet of points"
    topic = "doubtful"
    rank = 120

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        evidence = site.evidence
        if not {"inside", "contradicted"} & set(evidence.causes):
            return
        text = (
            f"{evidence.intact_points_inside} intact points lie on the removed skin, on "
            f"{evidence.skin_contradicted:.0%} of it"
        )
        yield Reason(self.code, text, "contradicts", evidence.skin_contradicted, remedy=self.remedy)
