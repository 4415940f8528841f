"""Over the same skin the points lie in two layers: one on the skin, one in the site."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

AGAINST = 0.12
"""Share of a site's points with another surface above them, on the skin. Of 40 scans with losses, wear and waves of
known truth one has 0.07 (a narrow groove), the others at most 0.01; views that are 1.5 tolerances and more too deep
have 0.06 to 0.4 where they overlap."""
OF_SCAN = 0.0115
"""Share of all points of a scan that lie on two surfaces, from which its views do not fit together. On the scans above
it is at most 0.006, on a shaft whose journals are worn on one side, and 0.011 on a gear whose teeth are cut along their
flanks; of 20 misplaced views 0.012 to 0.32, but for three that overlap little."""
EXPLAINED = 2.5
"""Depth of a site, in distances of the two surfaces, up to which the misplaced view explains it: where only one view
shows the skin, it lies too deep by more than it does across the view where both show it."""


def explains(own: float, depth: float, share: float, apart: float) -> bool:
    """Whether two surfaces over the same skin explain a site: the share of its ``own`` points among them, its typical
    ``depth``, and the ``share`` of all points among them and how far these are ``apart``."""
    return own > AGAINST or (share > OF_SCAN and depth < EXPLAINED * apart)


class TwoSheets(Rule):
    code = "two_sheets"
    meaning = "the scan shows two surfaces over the same skin: views do not fit together"
    threshold = (
        f"{AGAINST:.0%} of the site's points; or {OF_SCAN:.1%} of the scan's, for sites no deeper than {EXPLAINED:g} "
        "distances of the two"
    )
    remedy = "register the views again, or give them as a list of files"

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        share, apart = scan.sheets_share, scan.sheets_apart
        if not explains(site.two_sheets, site.typical, share, apart):
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
