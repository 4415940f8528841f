"""From a rough pose to the final one: the fits that follow each other, and the check of what they found."""

from __future__ import annotations

from dataclasses import dataclass

from damageest.artefacts import Floats
from damageest.stages.align.datum.by_system import finish_by_datum
from damageest.stages.align.datum.system import DatumSystem
from damageest.stages.align.refine.by_patches import refine_pose
from damageest.stages.align.refine.check_pose import PoseCheck
from damageest.stages.align.refine.largest_piece import prefer_largest_piece
from damageest.stages.align.refine.robust_fit import Fit
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.wear.check_worn import check_with_wear
from damageest.stages.align.wear.datum_skin import DatumSkin
from damageest.stages.align.wear.finish import Finish

FIRST = 10_000
"""Points of the fits before the last one, which takes all: theirs is only where it starts."""


@dataclass(frozen=True)
class LastFit:
    """What a pose is fitted to. ``points`` (N,3): spread evenly over the scan, in random order; ``raw`` (M,3): any
    unbiased subset of it; ``noise``, ``tolerance`` in diagonals; ``unit``: the job's; ``datum``: as for
    `finish_by_datum`.
    """

    frame: Frame
    points: Floats
    raw: Floats
    noise: float
    tolerance: float
    unit: str
    datum: DatumSkin | DatumSystem | None

    def run(self, start: Fit) -> tuple[Finish, PoseCheck]:
        """The last fit from ``start``, and how well its pose explains the scan."""
        target, points, noise = self.frame.target, self.points, self.noise
        best = refine_pose(target, points, prefer_largest_piece(target, points, start, noise))
        finish = finish_by_datum(self.frame, points, self.raw, best, noise, self.tolerance, self.unit, self.datum)
        return finish, check_with_wear(target, finish.fit, points, self.raw, self.tolerance, finish.worn_depth)
