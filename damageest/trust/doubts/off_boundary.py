"""The damaged points do not lie on the damage volume's boundary."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class OffBoundary(Rule):
    code = "off_boundary"
    meaning = "the damaged points of the site do not lie on the boundary of its damage volume"
    threshold = "5 % of them are farther from it than 1.5 tolerances and a quarter of the spacing"
    remedy = "compare the volume with the points in the report, and try method: surface"
    topic = "doubtful"
    rank = 110

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if "residual" not in site.evidence.causes:
            return
        off = site.evidence.ids_residual
        text = f"its boundary misses the damaged points (95 % within {off:.3g} {scan.unit})"
        yield Reason(self.code, text, "contradicts", off, scan.unit, remedy=self.remedy)
