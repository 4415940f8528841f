"""Motions of the scan that unworn skin does not exclude."""

from __future__ import annotations

from collections.abc import Iterable

from damageest.artefacts import Effect, Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteFacts

TOLD = 0.02
"""Change of the volume by the motion, as a share of it, from which it is told."""
OTHER_METAL = 1.0
"""Volume between the inner surface before and after the motion, as a share of the site's, from which the pose decides
which metal is lost and not only how much."""


class FreePoseRule(Rule):
    code = "free_pose"
    meaning = "unworn skin does not fix the pose, and the volume changes with it"
    threshold = f"{TOLD:.0%} of the volume; from {OTHER_METAL:.0%} of other metal on the poses contradict each other"
    remedy = "name unworn faces in align.datum"
    topic = "wear"
    rank = 220

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        for one in site.free:
            if one.moved <= TOLD * site.volume:
                continue
            ends = [max(site.volume + change, 0.0) for change in (one.low, one.high)]
            text = (
                f"the pose is free for {one.text}, which makes its volume {ends[0]:.4g} to {ends[1]:.4g} {scan.unit}³"
            )
            moves_away = one.moved - max(abs(one.low), abs(one.high)) > OTHER_METAL * site.volume
            if moves_away:
                text += ", and the lost metal may lie on the opposite side"
            effect: Effect = "contradicts" if moves_away else "widens"
            amount = (one.high - one.low) / 2
            yield Reason(self.code, text, effect, amount, f"{scan.unit}³", remedy=self.remedy)
