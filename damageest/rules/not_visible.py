"""The inner surface could not have been seen from where the skin beside it was seen."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

CONTRADICTED = 0.5
"""Share of the inner surface that could not have been seen. Right volumes have next to none, and what is left of a thin
wall, taken for what is lost, all of it."""


class NotVisible(Rule):
    code = "not_visible"
    meaning = "the scanner could not have seen this inner surface: the other side may be lost"
    threshold = (
        f"{CONTRADICTED:.0%} of the inner surface is closed in, or faces away from where the skin beside it was seen"
    )
    remedy = "give the position of the scanner for each view, or scan the other side of the wall"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        hidden = site.shut + site.turned
        if hidden <= CONTRADICTED:
            return
        how = (
            "lies in a closed cavity"
            if site.shut > site.turned
            else "faces away from where the skin beside it was seen"
        )
        text = f"{hidden:.0%} of its inner surface was invisible to the scanner: it {how}"
        yield Reason(self.code, text, "contradicts", remedy=self.remedy)
