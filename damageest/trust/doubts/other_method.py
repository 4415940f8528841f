"""The volume by the other method, where the job asks for both."""

from __future__ import annotations

import math
from collections.abc import Iterable

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts


class OtherMethod(Rule):
    code = "other_method"
    meaning = "method: both: the volume that the other method gives; one outside the interval contradicts the site"
    threshold = "the other volume is outside the interval"
    remedy = "compare this site in the results of method: surface and method: implicit, or scan it more densely"
    topic = "doubtful"
    rank = 200

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.other_volume is None or site.interval is None:
            return
        if math.isnan(site.other_volume):
            yield Reason(self.code, "the other method gave no volume to compare it with", remedy=self.remedy)
            return
        low, high = site.interval
        is_within, unit = low <= site.other_volume <= high, f"{scan.unit}³"
        text = f"the other method gives {site.other_volume:.4g} {unit}, "
        text += "within the interval" if is_within else f"outside the interval of {low:.4g} to {high:.4g} {unit}"
        yield Reason(
            self.code, text, "note" if is_within else "contradicts", abs(site.other_volume - site.volume), unit,
            remedy="" if is_within else self.remedy,
        )  # fmt: skip
