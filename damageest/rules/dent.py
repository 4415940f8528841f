"""The loss may be a dent."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts


class Dent(Rule):
    code = "dent"
    meaning = "the loss may be a dent: it has no edge, and the other side of a thin wall was not seen"
    threshold = "a wall up to half as thick as the loss is wide, of whose other side the scan shows less than 30 %"
    remedy = "scan the other side of the wall: a dent bulges there; a loss does not"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.bent_wall:
            text = (
                f"it may be a dent without lost metal: it has no edge, in a wall "
                f"{site.bent_wall:.3g} {scan.unit} thick whose other side is unseen"
            )
            yield Reason(self.code, text, "widens", site.volume, f"{scan.unit}³", remedy=self.remedy)
