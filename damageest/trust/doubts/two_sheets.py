"""Over the same skin the points lie in two layers: one on the skin, one in the site."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.views.two_sheets import (
    AGAINST,
    EXPLAINED,
    EXPLAINED_BY_MANY,
    MANY,
    OF_SCAN,
    Sheets,
    measure_two_sheets,
)


class TwoSheets(Rule):
    code = "two_sheets"
    meaning = "the scan shows two surfaces over the same skin: views do not fit together"
    threshold = (
        f"{AGAINST:.0%} of the site's points; or {OF_SCAN:.1%} of the scan's, for sites no deeper than {EXPLAINED:g} "
        f"distances of the two, or {EXPLAINED_BY_MANY:g} from {MANY:.0%} on"
    )
    remedy = "register the views again, or give them as a list of files"
    topic = "views"
    rank = 70

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        return {"two_sheets": measure_two_sheets(case.field, case.members, case.damage)}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        share, apart = scan.sheets_share, scan.sheets_apart
        if not Sheets(share, apart).explain(site.two_sheets, site.typical):
            return
        if site.two_sheets > AGAINST:
            text = (
                f"{site.two_sheets:.0%} of its points lie {site.typical:.3g} {scan.unit} below others on "
                "intact skin: two surfaces, probably of views that do not fit together"
            )
            yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)
        else:
            text = (
                f"at {share:.1%} of its points the scan shows two surfaces, {apart:.3g} {scan.unit} apart: a "
                "misplaced view explains the site"
            )
            yield Reason(self.code, text, "contradicts", apart, scan.unit, remedy=self.remedy)
