"""Over the same skin the points lie in two layers: one on the skin, one in the site."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

AGAINST = 0.3
"""Share of a site's points that lie among points on the skin. On a box it is below 0.2 at the rims of real losses, and
above 0.5 for a view that is 1.5 tolerances and more too deep."""


class TwoSheets(Rule):
    code = "two_sheets"
    meaning = (
        "over the same skin the scan shows two surfaces, one on the skin and one below it: views do not fit together"
    )
    threshold = f"{AGAINST:.0%} of the site's points lie among intact points"
    remedy = "register the views to each other again, or give them as a list of files, so that they can be compared"

    def ask(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.two_sheets <= AGAINST:
            return
        text = (
            f"{site.two_sheets:.0%} of its points lie among points on intact skin, {site.typical:.3g} {scan.unit} "
            "above them: the scan shows two surfaces there, and views may not fit together"
        )
        yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
