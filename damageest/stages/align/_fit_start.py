"""Fit from a rough pose, for the implementations that are given one."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align.datum.by_system import finish_by_datum
from damageest.stages.align.datum.option import Datum
from damageest.stages.align.datum.system import find_datum
from damageest.stages.align.refine.largest_piece import prefer_largest_piece
from damageest.stages.align.refine.robust_fit import fit
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.surface.oriented_points import draw_evenly, orient_scan
from damageest.stages.align.symmetry.ambiguity import find_loose_motions
from damageest.stages.align.wear.check_worn import check_with_wear
from damageest.stages.align.wear.finish import Finish


def fit_from_start(
    scan: Scan, part: Part, tolerance: float, T: Floats, reach: float, iterations: int, seed: int, remedy: str,
    datum: Datum = (),
) -> Pose:  # fmt: skip
    """The pose that the robust fit finds from ``T`` (4,4), a T_part_scan in the job's unit.

    ``reach``: largest distance of a scan point from the part in the first step, in diagonals of the part. ``datum``:
    what fixes the pose in the last fit. Raises StageError, with the ``remedy``, where its pose does not explain the
    scan, and where the fit does not converge.
    """
    on_datum = find_datum(part, datum)
    frame = Frame.build(scan, part)
    noise = scan.noise / frame.size
    rng = np.random.default_rng(seed)
    dense, weights, _ = orient_scan(frame.scale_points(scan), scan.normals, noise, 100, rng)
    points = rng.permutation(dense[draw_evenly(dense, weights, 30_000, rng)])
    best = fit(frame.target, points, frame.scale_pose(T), reach, noise, iterations)
    # Only above half the noise: a part that is free to rotate, such as a shaft, may rotate in every step.
    converged = best.residue <= 0.5 * max(noise, 1e-4)
    if converged:
        best = prefer_largest_piece(frame.target, points, best, noise)
    finish = Finish(best)
    if converged:
        finish = finish_by_datum(frame, points, dense, best, noise, tolerance / frame.size, part.unit, on_datum)
        best = finish.fit
    result = check_with_wear(frame.target, best, points, dense, tolerance / frame.size, finish.worn_depth)
    if not result.is_acceptable:
        raise result.build_error(remedy)
    if not converged:
        raise StageError(
            f"the fit did not converge in {iterations} iterations: the last step still changed the distances "
            f"of the scan points to the surface by {best.residue * frame.size:.3g} {part.unit} (rms)",
            "raise iterations, or use align: register",
        )
    doubts = result.note_doubts() + finish.doubts
    free, loose = finish.free, tuple[str, ...]()
    if not (free or finish.datums):
        free = find_loose_motions(frame, best.pose, points, best.band, part.unit)
        loose = tuple(one.text for one in free)
    pose = frame.unscale_pose(best.pose)
    notes = (*map(str, doubts), *loose, *finish.notes)
    return Pose(
        pose, result.rms * frame.size, result.inliers, notes=notes, doubts=doubts,
        free=free, is_held=finish.is_held, datums=finish.datums, left=finish.left, spread=finish.spread,
    )  # fmt: skip
