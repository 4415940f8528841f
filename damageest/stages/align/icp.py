"""Alignment from a known rough pose."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align import Align
from damageest.stages.align._frame import RigidPose


class Icp(Align):
    """Robust point-to-plane ICP on the part's triangles, from a rough pose (paper 3.1 step 3).

    Unlike plain ICP it is not shifted by damage: points off the surface get less weight with each step, at the end
    none.
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

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The fitted pose. Raises StageError where the fit does not converge, or its pose does not explain the scan."""
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
        result = check_pose(frame.target, best, points, dense, tolerance / frame.size)
        if not result.is_acceptable:
            raise result.build_error(
                "use align: register, which needs no initial pose; or give a closer T_part_scan, or a larger "
                f"max_distance (now {band * frame.size:.4g} {part.unit})"
            )
        # Only above half the noise: a part that is free to rotate, such as a shaft, may rotate in every step.
        if best.residue > 0.5 * max(noise, 1e-4):
            raise StageError(
                f"the fit did not converge in {self.iterations} iterations: the last step still changed the distances "
                f"of the scan points to the surface by {best.residue * frame.size:.3g} {part.unit} (rms)",
                "raise iterations, or use align: register",
            )
        return Pose(frame.unscale_pose(best.pose), result.rms * frame.size, result.inliers)
