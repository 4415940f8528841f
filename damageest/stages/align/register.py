"""Alignment with no initial guess."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Scan
from damageest.stages.align import Align


class Register(Align):
    """Finds the pose with no initial guess, then fits it robustly to the exact triangles (paper 3.1 step 3).

    Poses to try come from pairs of scan points with their normals that look like pairs on the part; all are refined and
    scored side by side, and the best compared point by point with their counterparts under the part's symmetries. A
    third of the metal missing, a third of the surface unseen, outliers and added metal are borne.
    """

    use: Literal["register"] = "register"
    seed: int = Option(0, ge=0, description="seed of the random draws; the same seed gives the same pose, bit by bit")
    trials: int = Option(60_000, ge=1000, le=2_000_000, description="number of poses tried before the best are refined")
    points: int = Option(30_000, ge=1000, le=120_000, description="number of scan points that the final fit rests on")

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """Raises StageError where no pose explains the scan: another part, another unit, or mostly clutter."""
        from damageest.errors import StageError
        from damageest.stages.align._check_pose import check_pose
        from damageest.stages.align._choose import COARSE, choose_pose, describe_choice, note_free_motion
        from damageest.stages.align._field import PlaneGrid
        from damageest.stages.align._fine import fit
        from damageest.stages.align._frame import MIN_POINTS, Frame
        from damageest.stages.align._pairs import propose_poses
        from damageest.stages.align._points import draw_evenly, draw_stratified, orient_scan, orient_surface
        from damageest.stages.align._refine_pose import refine_pose
        from damageest.stages.align._search import search

        frame = Frame.build(scan, part)
        target, noise = frame.target, scan.noise / frame.size
        rng = np.random.default_rng(self.seed)
        dense, weights, oriented = orient_scan(frame.scale_points(scan), scan.normals, noise, 3000, rng)
        if len(oriented.points) < MIN_POINTS // 4:
            raise StageError(
                f"only {len(oriented.points)} places of the scan look like a surface, the rest is too sparse or noisy",
                "give a denser scan, or align: none with the pose, if it is known",
            )
        field = PlaneGrid.build(target)
        rough = propose_poses(oriented, orient_surface(target.mesh, 20_000, rng), self.trials, rng)
        few = oriented.take(draw_stratified(len(oriented.points), 1500, rng))
        fine = rng.permutation(dense[draw_evenly(dense, weights, self.points, rng)])
        choice = choose_pose(search(rough, oriented, field, rng), target, field, few, fine, noise)
        best = refine_pose(target, fine, fit(target, fine, choice.pose, COARSE / 2, noise, 30))
        verdict = check_pose(target, best, fine, dense, tolerance / frame.size)
        if not verdict.is_acceptable:
            raise verdict.build_error(
                "check that scan and part belong together and have the right unit; crop a fixture or table away; where "
                "the pose is known, give it to align: icp or align: none"
            )
        others = np.array([frame.unscale_pose(pose) for pose in choice.others]) if len(choice.others) else None
        notes = describe_choice(choice, target) + note_free_motion(best.pose, target, fine, best.band)
        return Pose(frame.unscale_pose(best.pose), verdict.rms * frame.size, verdict.inliers, others, notes)
