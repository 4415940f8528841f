"""Few scan points lie on the site."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

FEW, TOO_FEW = 100, 12
"""Scan points below which a site's volume is a rough figure, and below which stray points explain it."""


class FewPoints(Rule):
    code = "few_points"
    meaning = "few scan points lie on the site"
    threshold = f"fewer than {FEW}; with fewer than {TOO_FEW}, all may be stray"
    remedy = "scan this place more densely"
    topic = "sparse"
    rank = 230

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.by_rays or site.count >= FEW:
            return
        text = f"only {site.count} scan points"
        if site.count < TOO_FEW:
            yield Reason(self.code, f"{text}: all may be stray", "contradicts", site.count, remedy=self.remedy)
        else:
            yield Reason(self.code, text, "widens", site.count, remedy=self.remedy)
