"""A shallow loss fades out."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts


class FadingOut(Rule):
    code = "fading"
    meaning = "the loss is shallow and has no edge: its volume depends on the depth from which it counts"
    threshold = "half of its skin is shallower than four tolerances"
    remedy = "decide which of the volumes counts: a smaller tolerance includes more"

    def ask(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        fading = site.uncertainty.fading if site.uncertainty else None
        if fading is None:
            return
        unit = scan.unit
        text = (
            "it is shallow, and the lost volume depends on the depth from which it counts: "
            f"{fading.half:.4g} {unit}³ from half the tolerance of {scan.tolerance:.3g} {unit} on, {fading.at:.4g} "
            f"from the tolerance on, {fading.twice:.4g} from twice the tolerance on; {fading.beyond:.3g} {unit}³ "
            f"({fading.beyond / max(site.volume, 1e-300):.1%}) fade out beyond its rim"
        )
        yield Reason(self.code, text, "widens", fading.beyond, f"{unit}³", remedy=self.remedy)
