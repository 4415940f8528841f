"""Part of the inner surface has no scan points."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts
from damageest.trust.interval.inner_surface import GAP

BARE = 0.25
"""Share of a site's inner surface without scan points from which it is told; from twice that on nothing limits the
volume."""
OPEN = 0.08
"""Share of the inner surface from which such a piece of twice the area limits nothing; of a site that rays prove, of
the whole surface of the damage volume, since the root of a thin wall is small."""


class InnerSurface(Rule):
    code = "inner_surface"
    meaning = "part of the inner surface has no scan points: the loss may be deeper there"
    threshold = (
        f"{BARE:.0%} of it, or {GAP:g} squares of the spacing in one piece; above twice either the upper end is open"
    )
    remedy = "scan into the damage from another side"
    topic = "unseen"
    rank = 170

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        evidence, unit = site.evidence, scan.unit
        inside = site.uncertainty.inside if site.uncertainty else 0.0
        if site.by_rays:  # rays prove that skin is gone, and not how deep the loss reaches behind it
            share = evidence.ids_gap / max(site.damage_area, 1e-300)
            is_told, is_open = share > OPEN / 2, share > OPEN
        else:
            gap = evidence.ids_gap / max(scan.tolerance, scan.spacing) ** 2
            share = evidence.ids_unseen
            is_told = gap > GAP or share > BARE or "bare" in evidence.causes
            is_open = (gap > 2 * GAP and share > OPEN) or share > 2 * BARE
        if is_told:
            of = "the surface of the damage volume" if site.by_rays else "its inner surface"
            text = (
                f"{share:.0%} of {of} has no scan points, {evidence.ids_gap:.3g} {unit}² in one piece: the loss may be "
                "deeper there"
            )
            amount = None if is_open else inside
            yield Reason(self.code, text, "open", amount, f"{unit}³", remedy=self.remedy)
