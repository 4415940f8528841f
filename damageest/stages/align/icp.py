"""Alignment from a pose that is already nearly right."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align import Align
from damageest.stages.align._frame import RigidPose


class Icp(Align):
    """Robust point-to-plane ICP to the exact triangles, from a rough pose (paper 3.1 step 3).

    Unlike plain ICP it is not drawn towards the damage: points off the surface lose their weight as the fit closes in.
    """

    use: Literal["icp"] = "icp"
    T_part_scan: RigidPose | None = Option(
        None, description="initial pose, 4x4, scanner's frame to the part's, in the job's unit; default: no motion"
    )
    max_distance: float | None = Option(
        None,
        gt=0,
        description="how far off a scan point may lie at first, in the job's unit; default: 3 % of the diagonal",
    )
    iterations: int = Option(60, ge=1, description="steps of the fit at most")
    seed: int = Option(
        0, ge=0, description="seed of the choice of points; the same seed gives the same pose, bit by bit"
    )

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """Raises StageError where the fit does not settle or what it settles on does not explain the scan."""
        from damageest.stages.align._check_pose import check_pose
        from damageest.stages.align._fine import fit
        from damageest.stages.align._frame import Frame
        from damageest.stages.align._points import draw_evenly, orient_scan

        frame = Frame.build(scan, part)
        noise = scan.noise / frame.size
        rng = np.random.default_rng(self.seed)
        dense, weights, _ = orient_scan(frame.scale_points(scan), scan.normals, noise, 100, rng)
        points = rng.permutation(dense[draw_evenly(dense, weights, 30_000, rng)])
        start = frame.scale_pose(np.eye(4) if self.T_part_scan is None else np.array(self.T_part_scan))
        band = 0.03 if self.max_distance is None else self.max_distance / frame.size
        best = fit(frame.target, points, start, band, noise, self.iterations)
        verdict = check_pose(frame.target, best, points, dense, tolerance / frame.size)
        if not verdict.is_acceptable:
            raise verdict.build_error(
                "align: register needs no initial pose; or give a closer T_part_scan, or a larger max_distance "
                f"(now {band * frame.size:.4g} {part.unit})"
            )
        # Half the noise: a slippery part, such as a shaft, may go on turning without end and be right all the same.
        if best.residue > 0.5 * max(noise, 1e-4):
            raise StageError(
                f"the fit did not settle in {self.iterations} iterations: its last step still moved the scan's points "
                f"by {best.residue * frame.size:.3g} {part.unit} off the surface",
                "raise iterations, or use align: register",
            )
        return Pose(frame.unscale_pose(best.pose), verdict.rms * frame.size, verdict.inliers)
