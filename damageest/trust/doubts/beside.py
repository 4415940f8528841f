"""Skin beside the site, or beside its rim, is not seen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.skin.unseen_rim import measure_unseen_rim

SKIN, SKIN_OPEN = 0.25, 0.5
"""Share of the skin beside a site without scan points from which it is told, and from which nothing shows where the
damage ends."""
RIM, RIM_OPEN = 0.08, 0.3
"""The same for the share of the rim that lies beside unseen skin. A bore that was scanned from both ends looks worn at
the ends; worn skin may go on where the scan does not show it."""


class Beside(Rule):
    code = "beside"
    meaning = "skin beside the site is unseen: the damage may continue there"
    threshold = (
        f"{SKIN:.0%} of the skin beside it or {RIM:.0%} of its rim; from {SKIN_OPEN:.0%} or {RIM_OPEN:.0%} on the "
        "upper end is open"
    )
    remedy = "scan the skin beside the damage"
    topic = "unseen"
    rank = 180

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        field = case.field
        reach = 2 * max(field.tolerance, field.aligned.spacing)
        return {"rim_unseen": measure_unseen_rim(case.damage, field.part, case.coverage, reach)}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.by_rays:
            return
        skin, rim = site.evidence.skin_unseen, site.rim_unseen
        if skin <= SKIN and rim < RIM:
            return
        is_open = skin > SKIN_OPEN or rim > RIM_OPEN
        beside = site.uncertainty.beside if site.uncertainty else 0.0
        words = [f"{skin:.0%} of the skin beside it has no scan points"] if skin > SKIN else []
        words += [f"{rim:.0%} of its rim lies beside unseen skin"] if rim >= RIM else []
        text = f"{' and '.join(words)}: the damage may continue there"
        yield Reason(self.code, text, "open", None if is_open else beside, f"{scan.unit}³", remedy=self.remedy)
