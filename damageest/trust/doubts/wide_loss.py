"""Whether a wide, shallow loss may lie elsewhere: in a pose a little away, other skin is worn and this is not."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Reason
from damageest.geometry.scan_field import ScanField
from damageest.trust.doubt import Rule, ScanFacts, SiteCase, SiteFacts
from damageest.trust.interval.pose_error import make_rows
from damageest.trust.skin.coverage import SkinView

WIDE, THIN = 0.12, 4.0
"""A site over a larger share of the seen skin than the first, and shallower in tolerances than the second, may be an
error of a fitted pose that no unworn skin is known to hold: worn metal, or a part of another size, moves it."""


ELSEWHERE = 0.5
"""Share of its depth that a motion of the scan explains which puts nothing outside, from which it may be none."""
DAMPING = 1e-6
"""What keeps motions still that no point tells, as a share of the largest sum of squares."""
OUTSIDE = 0.5
"""Distance outside the part, in tolerances, from which skin that a motion puts there speaks against it."""
MOST_OUTSIDE = 0.02
"""Share of the other skin that may come to lie there, by chance."""
ASKED = 5000
"""Points of a site, at most, that a motion is fitted to."""


class WideLoss(Rule):
    code = "wide_loss"
    meaning = "a shallow loss covers much of the skin, and lies on other skin in a nearby pose"
    threshold = (
        f"more than {WIDE:.0%} of the seen skin, half of it shallower than {THIN:g} tolerances, and {ELSEWHERE:.0%} of "
        "its depth explained by a motion that puts no skin outside"
    )
    remedy = "name unworn faces in align.datum, or give a known pose by align: none"
    topic = "wear"
    rank = 160

    def measure(self, case: SiteCase) -> Mapping[str, Any]:
        is_asked = case.scan.is_fitted
        return {"elsewhere": measure_elsewhere(case.field, case.members, case.skin, case.removed) if is_asked else 0.0}

    def find_reasons(self, site: SiteFacts, scan: ScanFacts) -> Iterable[Reason]:
        if not scan.is_fitted or site.area <= WIDE * scan.seen_area or site.typical >= THIN * scan.tolerance:
            return
        if site.elsewhere < ELSEWHERE:
            return
        # a part that is worn all over shows no skin where its CAD has it
        share = f"{site.area / scan.seen_area:.0%} of the skin" if scan.seen_area > 0 else "all skin"
        text = (
            f"it covers {share} seen, {site.typical:.3g} {scan.unit} deep: a small motion of the scan explains "
            f"{site.elsewhere:.0%} of it, and the loss may lie elsewhere"
        )
        yield Reason(self.code, text, "contradicts", site.typical, scan.unit, remedy=self.remedy)


def measure_elsewhere(field: ScanField, members: Ints, skin: SkinView, removed: Flags) -> float:
    """Share of the depth of a site's points (mean squares) that one small motion of the scan explains; 0 where that
    motion puts other skin outside the part, which no wear explains.

    Args:
        members: (M,) the site's scan points. removed: (C,) the cells of the skin that the site removes.
    """
    if not len(members):
        return 0.0
    some = members[:: max(1, len(members) // ASKED)]
    centre = field.part.bounds.mean(axis=0)
    size = field.part.diagonal / 4
    scale = np.array([1 / size] * 3 + [1.0] * 3)
    depth = -field.distance[some]
    rows = make_rows(field.points[some] - centre, field.find_normals(some)) * scale
    square = rows.T @ rows
    motion: Floats = np.linalg.solve(square + DAMPING * np.trace(square) * np.eye(6), rows.T @ depth)
    left = depth - rows @ motion
    explained = 1 - float((left**2).sum() / max((depth**2).sum(), 1e-300))
    cells = skin.cells
    other = np.flatnonzero(skin.perhaps_seen & np.isfinite(skin.distance) & ~removed)
    if not len(other):
        return explained
    before = skin.distance[other]
    after = before + (make_rows(cells.centres[other] - centre, cells.normals[other]) * scale) @ motion
    pushed = (after > OUTSIDE * field.tolerance) & (before < OUTSIDE * field.tolerance)
    area = cells.areas[other]
    return explained if float(area[pushed].sum()) <= MOST_OUTSIDE * float(area.sum()) else 0.0
