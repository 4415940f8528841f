"""What each damage volume is worth: proven, likely or doubtful, and why."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Deviation, Evidence, Floats, Ints, Pose, Scan
from damageest.checks.coverage import SkinView
from damageest.result import Verdict

SYSTEMATIC = 4.0
"""How many times deeper than the systematic deviation of intact skin a site is to be."""
FEW, TOO_FEW = 100, 12
"""Scan points below which a site's volume is a rough figure, and below which stray points explain it."""
MIXED = 0.3
"""Share of intact points over a site from which its rim is not clear."""
SHALLOW = 1.5
"""Depth in tolerances below which a site is shallow: its rim is then as wide as itself."""
UNSEEN = 0.5
"""Share of the skin beside a site from which nothing shows where the damage ends."""


@dataclass(frozen=True)
class ScanLimits:
    """What the whole scan cannot tell apart from damage. ``systematic``: standard deviation, in the job's unit, of the
    mean distances of intact cells of the skin that noise does not explain."""

    systematic: float


def measure_limits(skin: SkinView, aligned: Scan) -> ScanLimits:
    """How far intact skin deviates from the part over whole cells, beyond what the noise of eight points explains."""
    distance = skin.distance[skin.seen & np.isfinite(skin.distance)]
    if len(distance) < 30:
        return ScanLimits(0.0)
    # half the width of the middle 90 %, in standard deviations of a normal distribution
    low, high = np.quantile(distance, [0.05, 0.95])
    spread = float(max(-low, high)) / 1.645
    return ScanLimits(float(np.sqrt(max(spread**2 - aligned.noise**2 / 8, 0.0))))


def judge_site(
    evidence: Evidence, members: Ints, deviation: Deviation, pose: Pose, limits: ScanLimits, tolerance: float,
    unit: str, proven_by_rays: bool, beside: tuple[str, ...] = (), unknown: tuple[str, ...] = (),
) -> Verdict:  # fmt: skip
    """Weighs all that speaks for and against a damage volume.

    ``members``: numbers of the scan points on it; ``proven_by_rays``: rays passed through the metal that it removes;
    ``beside``: what lies beside it and makes it doubtful, such as surplus of like size; ``unknown``: what the scan does
    not show of it.
    """
    depth: Floats = -deviation.distance[members]
    typical, deepest = (float(np.quantile(depth, q)) for q in (0.5, 0.95)) if len(depth) else (0.0, 0.0)
    against: list[str] = []
    open_questions = list(unknown)
    for reason in evidence.reasons:
        unseen_only = reason.endswith("the damage may extend there") and evidence.skin_unseen <= UNSEEN
        (open_questions if unseen_only or (proven_by_rays and "no scan point" in reason) else against).append(reason)
    if not proven_by_rays and deepest < SYSTEMATIC * limits.systematic and limits.systematic > 0.15 * tolerance:
        against.append(
            f"it is {deepest:.3g} {unit} deep, and intact skin deviates by {limits.systematic:.3g} {unit} over whole "
            "areas (pose, form of the part, or scanner): it cannot be told from that"
        )
    elif not proven_by_rays and typical < SYSTEMATIC * limits.systematic and limits.systematic > 0.15 * tolerance:
        open_questions.append(
            f"intact skin deviates by {limits.systematic:.3g} {unit} over whole areas, which changes its volume"
        )
    if proven_by_rays:
        pass
    elif len(members) < TOO_FEW:
        against.append(f"only {len(members)} scan points lie on it; stray points explain it")
    elif len(members) < FEW:
        open_questions.append(f"only {len(members)} scan points lie on it")
    if evidence.consistent and evidence.intact_share > MIXED and not proven_by_rays:
        open_questions.append(
            f"{evidence.intact_share:.0%} of the scan points over the skin that it removes lie on that skin: its rim "
            "is not clear"
        )
    if deepest < SHALLOW * tolerance and not proven_by_rays:
        open_questions.append(f"it is less than {SHALLOW:g} tolerances deep: its rim fades out below the tolerance")
    against += [*pose_doubts(pose), *beside]
    if against:
        return Verdict("doubtful", (*against, *open_questions))
    return Verdict("likely" if open_questions else "proven", tuple(open_questions))


def pose_doubts(pose: Pose) -> tuple[str, ...]:
    """What makes every site doubtful because the pose is not sure."""
    return tuple(getattr(pose, "doubts", ()))
