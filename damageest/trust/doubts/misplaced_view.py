"""A view that lies apart from the others, and was not moved, explains the site."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts

AGAINST = 0.5
"""Share of a site's points that a misplaced view explains."""


class MisplacedView(Rule):
    code = "misplaced_view"
    meaning = "a misplaced view that was not moved explains the site"
    threshold = f"{AGAINST:.0%} of the site's points"
    remedy = "register the views again, by align: register or in the scanner's software, or scan more of their overlap"
    topic = "views"
    rank = 80

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        views = case.views
        return {"misplaced": 0.0 if views is None else views.find_explained(case.field, case.members)}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.misplaced > AGAINST:
            text = (
                f"{site.misplaced:.0%} of its points are in a misplaced view, which explains them: "
                f"{site.typical:.3g} {scan.unit} deep"
            )
            yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
