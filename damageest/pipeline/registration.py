"""Where the scan lies on which part: what is put right after the alignment takes this and gives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from damageest.artefacts import Part, Pose, Reason, Scan


@dataclass(frozen=True, eq=False)
class Registration:
    """The ``scan`` and its ``pose`` on the ``part``; ``aligned``: the scan in the part's frame, as corrections of its
    views and scale leave it; the ``tolerance``; and ``warnings``: the notes of the run so far, of which a correction
    settles some."""

    scan: Scan
    part: Part
    pose: Pose
    aligned: Scan
    tolerance: float
    warnings: Sequence[Reason]
