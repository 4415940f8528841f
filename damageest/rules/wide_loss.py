"""A shallow loss over much of the skin, in a pose that no unworn skin is known to hold."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

WIDE, THIN = 0.12, 4.0
"""A site over a larger share of the seen skin than the first, and shallower in tolerances than the second, may be an
error of a fitted pose that no unworn skin is known to hold: worn metal, or a part of another size, moves it."""


ELSEWHERE = 0.5
"""Share of its depth that a motion of the scan explains which puts nothing outside, from which it may be none."""


class WideLoss(Rule):
    code = "wide_loss"
    meaning = "a shallow loss covers much of the skin, and lies on other skin in a nearby pose"
    threshold = (
        f"more than {WIDE:.0%} of the seen skin, half of it shallower than {THIN:g} tolerances, and {ELSEWHERE:.0%} of "
        "its depth explained by a motion that puts no skin outside"
    )
    remedy = "name unworn faces in align.datum, or give a known pose by align: none"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if not scan.is_fitted or site.area <= WIDE * scan.seen_area or site.typical >= THIN * scan.tolerance:
            return
        if site.elsewhere < ELSEWHERE:
            return
        # a part that is worn all over shows no skin where its CAD has it
        share = f"{site.area / scan.seen_area:.0%} of the skin" if scan.seen_area > 0 else "all skin"
        text = (
            f"it covers {share} seen, {site.typical:.3g} {scan.unit} deep: a small motion of the scan explains "
            f"{site.elsewhere:.0%} of it, and the loss may lie elsewhere"
        )
        yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
