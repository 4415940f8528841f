"""A view that lies apart from the others, and was not moved, explains the site."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

AGAINST = 0.5
"""Share of a site's points that a misplaced view explains."""


class MisplacedView(Rule):
    code = "misplaced_view"
    meaning = (
        "views lie apart where they overlap, and the site lies in one that was not moved: put right, it shows the skin "
        "there, or what it shows there does not say how far it is off"
    )
    threshold = f"{AGAINST:.0%} of the site's points"
    remedy = "align: register moves views; else register them to each other again, or scan more of what both show"

    def ask(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.misplaced > AGAINST:
            text = (
                f"{site.misplaced:.0%} of its points are in a view that lies apart from the others, and that explains "
                f"them: {site.typical:.3g} {scan.unit} deep"
            )
            yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
