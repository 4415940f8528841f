"""What the stage align says against its pose."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from damageest.artefacts import Reason
from damageest.rules import Rule, ScanFacts, SiteFacts

DIFFERS = 0.02
"""Share of the skin that a site removes which is not skin in another pose that fits as well, from which the pose
decides which metal is lost."""
EXPLAINED = 1.5
"""Depth of a site, in the movement of the skin by a pose nearby that explains the whole scan, up to which that pose
contradicts the site."""


POSE_CODES = {
    "another_part": "little of the scan near the part lies on its surface: it may show another part or revision",
    "other_poses": "poses fit that are not symmetries of the part; it matters where other metal is lost in them",
    "pose_free": "the part can be moved or turned a little and fits as well",
    "mirrored": "the scan fits better mirrored, and shows too little of the part to tell",
    "wrong_scale": "the scan lies on the part far better in another scale",
    "datum_worn": "a datum is worn or not in its place: the datum system puts it, or the skin, elsewhere",
    "datum_decides": "the scan fits as well in poses that the datum system excludes: it decides which metal is lost",
    "given_pose": "in a pose nearby more of the scan lies on the part than in the given one",
}
"""Codes of the reasons that implementations of align give against their pose."""


class PoseDoubt(Rule):
    code = "pose"
    meaning = "the pose may be wrong, or other poses fit as well in which other metal is lost"
    threshold = (
        f"as the stage align says; where other poses fit, {DIFFERS:.0%} of the removed skin lies elsewhere in one"
    )
    remedy = "give the pose to align: none or align: icp, or pick points with align: points"

    def ask(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        for reason in scan.pose:
            if reason.code == "other_poses" and site.other_poses <= DIFFERS:
                continue
            if reason.code == "given_pose" and site.typical > EXPLAINED * (reason.amount or 0.0):
                reason = replace(reason, effect="open")
            yield reason
