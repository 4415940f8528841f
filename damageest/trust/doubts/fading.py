"""A shallow loss fades out."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class FadingOut(Rule):
    code = "fading"
    meaning = "the loss is shallow and has no edge: its volume depends on the counted depth"
    threshold = "half of its skin is shallower than four tolerances"
    remedy = "choose the depth that counts: a smaller tolerance includes more"
    topic = "noise"
    rank = 240

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        fading = site.uncertainty.fading if site.uncertainty else None
        if fading is None:
            return
        unit = scan.unit
        text = (
            "shallow loss, its volume depends on the counted depth: "
            f"{fading.half:.4g} {unit}³ beyond half the tolerance of {scan.tolerance:.3g} {unit}, {fading.at:.4g} "
            f"beyond the tolerance, {fading.twice:.4g} beyond twice the tolerance; {fading.beyond:.3g} {unit}³ "
            f"({fading.beyond / max(site.volume, 1e-300):.1%}) fade beyond its rim"
        )
        yield Reason(self.code, text, "widens", fading.beyond, f"{unit}³", remedy=self.remedy)
