"""Many shallow sites: waves of the part's form or of the scanner."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

SHALLOW, MANY, ALIKE = 2.0, 8, 0.1
"""Depth of a site in tolerances, in 95 % of its points, up to which it is shallow; number of such sites from which
waves explain them; and the share of its volume from which they are as large as it. An undamaged plate whose skin is
wavy inward alone, by 1.5 tolerances, has 15."""


class Scattered(Rule):
    code = "scattered"
    meaning = "many shallow sites: waves of the part's form or of the scanner explain them"
    threshold = (
        f"{MANY} sites no deeper than {SHALLOW:g} tolerances and of {ALIKE:.0%} of its volume, of which it is one"
    )
    remedy = "a larger tolerance, or accept: all where it is wear"
    topic = "noise"
    rank = 100

    def compare(self, site: SiteFacts, each: Sequence[SiteFacts], scan: ScanFacts) -> Mapping[str, Any]:
        waves = [one.volume for one in each if one.count and one.deepest < SHALLOW * scan.tolerance]
        return {"shallow": sum(volume >= ALIKE * site.volume for volume in waves)}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if site.shallow >= MANY and site.deepest < SHALLOW * scan.tolerance:
            text = (
                f"one of {site.shallow} sites of its size, no deeper than {SHALLOW:g} tolerances: waves of part or "
                "scanner may explain them"
            )
            yield Reason(self.code, text, "contradicts", site.shallow, remedy=self.remedy)
