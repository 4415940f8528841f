"""Alignment without an initial pose."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from pydantic import Field as Option

from damageest.artefacts import Part, Pose, Reason, Scan
from damageest.stages.align import Align
from damageest.stages.align.datum.option import NO_DATUM, Datum


class Register(Align):
    """Finds the pose without an initial one, then fits it robustly to the part's triangles (paper 3.1 step 3).

    Candidate poses come from pairs of scan points with normals that match pairs on the part. All are refined and
    scored; the best are compared with their images under symmetries of the part. It works with a third of the metal
    missing, with a third of the surface unseen, with outliers and with added metal.
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
        "misplaced one is corrected, if it fixes its pose by itself",
    )
    datum: Datum = NO_DATUM

    @property
    def moves_views(self) -> bool:
        return self.fit_views

    @property
    def datums(self) -> Datum:
        return self.datum

    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        """The fitted pose. Raises StageError where no pose explains the scan: it shows another part, has another unit,
        or most of it is not the part."""
        from damageest.errors import StageError
        from damageest.stages.align.datum.last_fit import FIRST, LastFit
        from damageest.stages.align.datum.system import find_datum
        from damageest.stages.align.handedness.mirror import MIN_GAIN, MirrorTest, check_handedness
        from damageest.stages.align.handedness.normals import SignedNormals, note_inward, prefer_outward
        from damageest.stages.align.handedness.scale import check_scale
        from damageest.stages.align.refine.robust_fit import fit
        from damageest.stages.align.search.pairs import propose_poses
        from damageest.stages.align.search.search import search
        from damageest.stages.align.surface.frame import MIN_POINTS, Frame
        from damageest.stages.align.surface.oriented_points import draw_evenly, draw_stratified, orient_scan
        from damageest.stages.align.symmetry.ambiguity import describe_choice, find_loose_motions, note_ambiguity
        from damageest.stages.align.symmetry.choose import COARSE, Choice, choose_pose
        from damageest.stages.align.symmetry.prepare_part import prepare_part

        datum = find_datum(part, self.datum)
        frame = Frame.build(scan, part)
        target, noise = frame.target, scan.noise / frame.size
        rng = np.random.default_rng(self.seed)
        normals = SignedNormals.read(scan)
        dense, weights, given = orient_scan(frame.scale_points(scan), normals.normals, noise, 3000, rng)
        if len(given.points) < MIN_POINTS // 4:
            raise StageError(
                f"only {len(given.points)} places of the scan have a clear normal (at least {MIN_POINTS // 4} are "
                "needed): it is too sparse or too noisy",
                "give a denser scan; where the pose is known, give it to align: none",
                topic="sparse",
            )
        prepared = prepare_part(target, self.seed)
        target, field = prepared.surface, prepared.grid
        # Signs that no scanner position confirms: poses are searched for without them first, and then with them.
        oriented = replace(given, signed=given.signed and normals.is_proven)
        rough = propose_poses(oriented, prepared.pairs, self.trials, rng)
        few = oriented.take(draw_stratified(len(oriented.points), 1500, rng))
        fine = rng.permutation(dense[draw_evenly(dense, weights, self.points, rng)])
        poses = search(rough, oriented, field, rng)
        if given.signed and not oriented.signed:
            more = search(propose_poses(given, prepared.pairs, self.trials, rng), given, field, rng)
            poses = np.concatenate([poses, more])
        choice = choose_pose(poses, prepared, few, fine, noise)
        if given.signed:
            choice = choice.keep(prefer_outward(target, given, choice.poses, choice.band))
        last = LastFit(frame, fine, dense, noise, tolerance / frame.size, part.unit, datum)
        finish, check = last.run(fit(target, fine[:FIRST], choice.pose, COARSE / 2, noise, 30))
        doubts: tuple[Reason, ...] = ()
        test = MirrorTest(
            prepared, oriented, fine, dense, noise, tolerance / frame.size, self.trials, scan.normals is not None
        )
        scaled = check_scale(test, finish.fit, check, rng)
        if scaled is not None:
            if not check.is_acceptable:
                raise scaled.build_error(check)
            doubts = (scaled.make_doubt(check),)
        elif check.agreement < 1 - MIN_GAIN:  # else no mirrored pose can be that much better
            hand = check_handedness(test, finish.fit, check, rng)
            doubts = hand.doubts
            if hand.better is not None:
                choice = Choice(hand.better.pose, hand.others, None, choice.band)
                finish, check = last.run(hand.better)
        best = finish.fit
        if not check.is_acceptable:
            raise check.build_error(_advise(scan))
        others = None
        if len(choice.others):
            # a symmetry of the part takes the pose found to each of the others
            turns = choice.others @ np.linalg.inv(choice.pose)
            poses = turns @ best.pose if finish.is_changed else choice.others
            others = np.array([frame.unscale_pose(pose) for pose in poses])
        doubts = check.note_doubts() + finish.doubts + doubts + note_ambiguity(choice, prepared)
        free, loose = finish.free, tuple[str, ...]()
        if not (free or finish.datums):
            free = find_loose_motions(frame, best.pose, fine[:FIRST], best.band, part.unit)
            loose = tuple(one.text for one in free)
        told = note_inward(target, frame, scan, best)
        notes = (*describe_choice(choice), *told, *map(str, doubts), *loose, *finish.notes)
        pose = frame.unscale_pose(best.pose)
        rms = check.rms * frame.size
        return Pose(
            pose, rms, check.inliers, others, notes, doubts, free, finish.is_held, finish.datums, finish.left,
            finish.spread,
        )  # fmt: skip


def _advise(scan: Scan) -> str:
    """What to do where no pose explains the scan."""
    views = 0 if scan.view is None else len(np.unique(scan.view[scan.view >= 0]))
    apart = f"check that the {views} views fit together; " if views > 1 else ""
    return (
        f"check part, scan and units; {apart}crop away fixture or table; where the pose is known, give it to align: "
        "icp or align: none"
    )
