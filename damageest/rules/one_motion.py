"""One motion of all points of the site brings them back onto the skin."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

ALIKE = 1.5
"""Depth of another site, in depths of the one that a motion explains, up to which it is of the same view."""


class OneMotion(Rule):
    code = "one_motion"
    meaning = "one motion brings the site's points, on several faces, back onto the skin: a view is misplaced"
    threshold = (
        "the rest is noise, in nine tenths of its points; a site of 5% of the scan's points or more. Other "
        f"sites up to {ALIKE:g} times as deep may be of the same view"
    )
    remedy = "register the views again, or give them as a list of files"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.one_motion:
            text = (
                f"its {site.count} points, {site.typical:.3g} {scan.unit} deep, fit the skin after one "
                "motion: a misplaced view explains the site"
            )
            yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
        elif 0 < site.typical < ALIKE * site.shifted:
            text = (
                f"a misplaced view explains another site, {site.shifted:.3g} {scan.unit} deep, and may explain this one"
            )
            yield Reason(self.code, text, "contradicts", site.shifted, scan.unit, remedy=self.remedy)
