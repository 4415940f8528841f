"""The same shape is lost here and added elsewhere."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class Revision(Rule):
    code = "revision"
    meaning = "metal of the same shape is added elsewhere: another revision with a moved feature?"
    threshold = "volumes within 10 %, and extents (principal radii of gyration) within 12 %"
    remedy = "compare the scan with the drawing of the part's revision; accept the site if the loss is real"
    topic = "surplus"
    rank = 60

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        for number in site.twins:
            text = (
                f"surplus {number} has the same shape: the scan may show another revision with a moved "
                "feature, without lost metal"
            )
            yield Reason(self.code, text, "contradicts", site.volume, f"{scan.unit}³", remedy=self.remedy)
