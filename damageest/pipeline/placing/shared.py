"""What can be compared, where an earlier scan stands for the part."""

from __future__ import annotations

from dataclasses import replace

from damageest.artefacts import Part, Reason, Scan
from damageest.errors import StageError
from damageest.pipeline.state import Reasons
from damageest.trust.skin.shared_skin import find_unshared

FEWEST = 100
"""Points on skin that both scans show, below which nothing can be compared."""


def keep_shared(scan: Scan, aligned: Scan, part: Part, tolerance: float, unit: str) -> tuple[Scan, Scan, Reasons]:
    """Sets the points aside that show skin which the earlier scan does not. Raises StageError where nearly none is
    left. Nothing is changed where the part is as designed."""
    if part.unseen is None:
        return scan, aligned, ()
    unseen, other = find_unshared(aligned.points, aligned.spacing, part, tolerance)
    kept = ~(unseen | other)
    if kept.sum() < FEWEST:
        raise StageError(
            "the two scans have no skin in common in the pose found", "scan sides that the earlier scan shows as well"
        )
    area = float(part.face_areas[~part.unseen].sum())
    text = (
        f"the earlier scan shows {area:.4g} {unit}² of skin, and the result holds there alone; {1 - kept.mean():.0%} "
        "of the later scan's points show other skin and were removed"
    )
    if other.any():
        text += f", {int(other.sum())} of them below the skin, on surfaces that may have been there before"
    remedy = "check that part and scan are not swapped"
    told = Reason("earlier_scan", text, amount=float(1 - kept.mean()), remedy=remedy)
    return (replace(scan, notes=(*scan.notes, text)).take(kept), aligned.take(kept), [told])
