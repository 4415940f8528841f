"""What the stage align says against its pose."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from damageest.artefacts import Reason
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.interval.free_pose import compare_other_poses

DIFFERS = 0.02
"""Share of the skin that a site removes which is not skin in another pose that fits as well, from which the pose
decides which metal is lost."""
EXPLAINED = 1.5
"""Depth of a site, in the movement of the skin by a pose nearby that explains the whole scan, up to which that pose
contradicts the site."""


POSE_CODES = {
    "another_part": "little of the scan near the part lies on its surface: it may show another part or revision",
    "other_poses": "other poses fit that are no symmetries of the part",
    "pose_free": "the pose is not fixed: small motions fit as well",
    "mirrored": "the scan fits better mirrored, and shows too little to tell",
    "wrong_scale": "the scan fits far better in another scale",
    "datum_worn": "a datum is worn or misplaced",
    "datum_decides": "the datums decide between equally good poses",
    "shared_table": "objects on a table in both scans contradict the pose",
    "given_pose": "a nearby pose fits better than the given one",
}
"""Codes of the reasons that implementations of align give against their pose."""


class PoseDoubt(Rule):
    code = "pose"
    meaning = "the pose may be wrong, or another pose with other lost metal fits as well"
    threshold = (
        f"as the stage align says; where other poses fit, {DIFFERS:.0%} of the removed skin lies elsewhere in one"
    )
    remedy = "give the pose to align: none or align: icp, or pick points with align: points"
    topic = "pose"
    rank = 30

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        moved = compare_other_poses(case.damage, case.field.part, case.pose, case.field.tolerance)
        return {"other_poses": moved}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        for reason in scan.pose:
            if reason.code == "other_poses" and site.other_poses <= DIFFERS:
                continue
            if reason.code == "given_pose" and site.typical > EXPLAINED * (reason.amount or 0.0):
                reason = replace(reason, effect="open")
            yield reason
