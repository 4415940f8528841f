"""Surplus beside the site is as large as the loss."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class Displaced(Rule):
    code = "displaced"
    meaning = "surplus beside the site is as large as the loss: a piece may be displaced, or the part may be bent"
    threshold = "volumes within 35 %; within 10 % where the surplus touches the site"
    remedy = "put the piece back and scan again, or accept the site to repair it as if the piece were lost"
    topic = "surplus"
    rank = 50

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        for number in site.displaced:
            text = f"surplus {number} beside it is as large: a displaced piece or a bent part, without lost metal?"
            yield Reason(self.code, text, "contradicts", site.volume, f"{scan.unit}³", remedy=self.remedy)
