"""Alignment from a known rough pose."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Scan
from damageest.stages.align import Align
from damageest.stages.align.datum.option import NO_DATUM, Datum
from damageest.stages.align.surface.frame import RigidPose


class Icp(Align):
    """Robust point-to-plane ICP on the part's triangles, from a rough pose (paper 3.1 step 3).

    Damage does not shift it: points off the surface get less weight with each step, at the end none.
    """

    use: Literal["icp"] = "icp"
    T_part_scan: RigidPose | None = Option(
        None,
        description="initial pose T_part_scan, 4x4, from the scan's frame to the part's, in the job's unit; default: "
        "identity",
    )
    max_distance: float | None = Option(
        None,
        gt=0,
        description="largest distance of a scan point from the part in the first step, in the job's unit; default: 3 % "
        "of the part's diagonal",
    )
    iterations: int = Option(60, ge=1, description="largest number of steps of the fit")
    seed: int = Option(
        0, ge=0, description="seed of the random choice of points; the same seed gives the same pose, bit for bit"
    )
    datum: Datum = NO_DATUM

    @property
    def datums(self) -> Datum:
        return self.datum

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The fitted pose. Raises StageError where the fit does not converge, or its pose does not explain the scan."""
        from damageest.stages.align._fit_start import fit_from_start

        reach = 0.03 if self.max_distance is None else self.max_distance / part.diagonal
        remedy = (
            "use align: register, which needs no initial pose; or give a closer T_part_scan, or a larger "
            f"max_distance (now {reach * part.diagonal:.4g} {part.unit})"
        )
        T = np.eye(4) if self.T_part_scan is None else np.array(self.T_part_scan)
        return fit_from_start(scan, part, tolerance, T, reach, self.iterations, self.seed, remedy, self.datum)
