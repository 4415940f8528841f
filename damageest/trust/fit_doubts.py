"""Whether a run may say that the part as designed explains the intact skin.

That no bend, twist or scale was found says little where the pose is doubtful, or where much lies outside the part: a
wrong pose, or another part, has no such form either.
"""

from __future__ import annotations

from collections.abc import Mapping

from damageest.artefacts import ADDED, Pose
from damageest.findings import Surplus, Verdict
from damageest.geometry.scan_field import ScanField
from damageest.geometry.voxels import measure_area
from damageest.trust.scan_facts import FEWEST_OUTSIDE
from damageest.trust.skin.coverage import SkinView

LARGE = 0.1
"""Area outside the part, as a share of the skin that the scan shows, from which it is no weld bead or dirt on skin that
is as designed otherwise."""
BY_FORM = frozenset({"nothing", "wide_loss"})
"""Codes of reasons by which skin that deviates may be all that a doubtful site shows."""


def find_fit_doubts(
    pose: Pose, verdicts: Mapping[int, Verdict], surplus: tuple[Surplus, ...], displaced: frozenset[int],
    field: ScanField, skin: SkinView,
) -> tuple[str, ...]:  # fmt: skip
    """Reasons to doubt that the part as designed explains the intact skin, as clauses of a sentence; empty where there
    is none.

    Args:
        verdicts: of the sites, by their numbers. displaced: the numbers of sites beside a piece that may be displaced.
        field, skin: that of the scan after strays were taken out, and what it shows of the skin.
    """
    found = []
    if pose.doubts:
        found.append("the pose is doubtful")
    by_form = sorted(
        number
        for number, verdict in verdicts.items()
        if verdict.level == "doubtful" and (number in displaced or BY_FORM & {one.code for one in verdict.reasons})
    )
    if by_form:
        names = f"site{'s' if len(by_form) > 1 else ''} {', '.join(map(str, by_form))}"
        found.append(f"{names} may be deviating skin without damage")
    outside = field.label == ADDED
    for one in surplus:
        if one.kind == "surroundings":
            outside[one.points] = False
    seen = float(skin.cells.areas[skin.perhaps_seen].sum())
    if outside.any():
        area = measure_area(field.points[outside], skin.cells.edge, FEWEST_OUTSIDE)
        if area > LARGE * max(seen, 1e-300):
            found.append(f"an area of {area / max(seen, 1e-300):.0%} of the seen skin lies outside the part")
    return tuple(found)
