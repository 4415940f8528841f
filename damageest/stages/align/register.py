"""Alignment without an initial pose."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Scan
from damageest.stages.align import Align
from damageest.stages.align._datum import NO_DATUM, Datum


class Register(Align):
    """Finds the pose without an initial one, then fits it robustly to the part's triangles (paper 3.1 step 3).

    Candidate poses come from pairs of scan points with normals that match pairs on the part. All are refined and
    scored, and the best are compared point by point with the poses that a symmetry of the part makes of them. It works
    with a third of the metal missing, with a third of the surface unseen, with outliers and with added metal.
    """

    use: Literal["register"] = "register"
    seed: int = Option(0, ge=0, description="seed of the random draws; the same seed gives the same pose, bit for bit")
    trials: int = Option(
        60_000, ge=1000, le=2_000_000, description="number of candidate poses tried; the best are refined"
    )
    points: int = Option(30_000, ge=1000, le=120_000, description="number of scan points used by the final fit")
    fit_views: bool = Option(
        True,
        description="whether each view of a scan with known views is fitted to the part where the views disagree: a "
        "misplaced one is put right, if it fixes its pose by itself",
    )
    datum: Datum = NO_DATUM

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The fitted pose. Raises StageError where no pose explains the scan: it shows another part, has another unit,
        or most of it is not the part."""
        from damageest.errors import StageError
        from damageest.stages.align._check_worn import check_with_wear
        from damageest.stages.align._choose import (
            COARSE,
            choose_pose,
            describe_choice,
            note_ambiguity,
            note_free_motion,
        )
        from damageest.stages.align._datum import DatumSkin
        from damageest.stages.align._fine import fit
        from damageest.stages.align._finish import finish_pose
        from damageest.stages.align._frame import MIN_POINTS, Frame
        from damageest.stages.align._largest_piece import prefer_largest_piece
        from damageest.stages.align._mirror import (
            MIN_GAIN,
            SUSPECT,
            fit_reflections,
            refuse_mirrored,
            search_mirrored,
        )
        from damageest.stages.align._pairs import propose_poses
        from damageest.stages.align._points import draw_evenly, draw_stratified, orient_scan
        from damageest.stages.align._prepare_part import prepare_part
        from damageest.stages.align._refine_pose import refine_pose
        from damageest.stages.align._search import search

        datum = DatumSkin.find(part, self.datum)
        frame = Frame.build(scan, part)
        target, noise = frame.target, scan.noise / frame.size
        rng = np.random.default_rng(self.seed)
        dense, weights, oriented = orient_scan(frame.scale_points(scan), scan.normals, noise, 3000, rng)
        if len(oriented.points) < MIN_POINTS // 4:
            raise StageError(
                f"only {len(oriented.points)} places of the scan have a clear normal (at least {MIN_POINTS // 4} are "
                "needed): it is too sparse or too noisy",
                "give a denser scan; where the pose is known, give it to align: none",
            )
        prepared = prepare_part(target, self.seed)
        target, field = prepared.surface, prepared.grid
        rough = propose_poses(oriented, prepared.pairs, self.trials, rng)
        few = oriented.take(draw_stratified(len(oriented.points), 1500, rng))
        fine = rng.permutation(dense[draw_evenly(dense, weights, self.points, rng)])
        choice = choose_pose(search(rough, oriented, field, rng), target, field, few, fine, noise)
        best = fit(target, fine, choice.pose, COARSE / 2, noise, 30)
        best = refine_pose(target, fine, prefer_largest_piece(target, fine, best, noise))
        finish = finish_pose(frame, fine, best, noise, tolerance / frame.size, part.unit, datum)
        best = finish.fit
        check = check_with_wear(target, best, fine, dense, tolerance / frame.size, finish.worn_depth)
        if check.agreement < 1 - MIN_GAIN:  # else no mirrored pose can be that much better
            mirrored = (
                search_mirrored(prepared, oriented, fine, noise, self.trials, rng)
                if check.agreement < SUSPECT
                else fit_reflections(target, field, fine, best, noise)
            )
            refuse_mirrored(target, fine, dense, best.pose, check, mirrored, tolerance / frame.size)
        if not check.is_acceptable:
            raise check.build_error(_advise(scan))
        others = None
        if len(choice.others):
            # a symmetry of the part takes the pose found to each of the others
            turns = choice.others @ np.linalg.inv(choice.pose)
            poses = turns @ best.pose if finish.is_changed else choice.others
            others = np.array([frame.unscale_pose(pose) for pose in poses])
        doubts = check.note_doubts() + note_ambiguity(choice, target)
        if not finish.free:  # those have amounts, and are terms of the intervals
            doubts += note_free_motion(best.pose, target, fine, best.band)
        notes = (*describe_choice(choice), *map(str, doubts), *finish.notes)
        pose = frame.unscale_pose(best.pose)
        rms = check.rms * frame.size
        return Pose(pose, rms, check.inliers, others, notes, doubts, finish.free, finish.is_held)


def _advise(scan: Scan) -> str:
    """What to do where no pose explains the scan."""
    views = 0 if scan.view is None else len(np.unique(scan.view[scan.view >= 0]))
    apart = f"check that the {views} views of the scan are not misplaced against each other; " if views > 1 else ""
    return (
        f"check that the scan shows this part and that both have the right unit; {apart}crop away a fixture or table; "
        "where the pose is known, give it to align: icp or align: none"
    )
