"""Checks a pose that was given and is not to be changed."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from damageest.artefacts import Effect, Floats, Part, Reason, Scan
from damageest.errors import StageError
from damageest.geometry.transforms import move_points
from damageest.stages.align.handedness.mirror import MIN_GAIN as LEAST_OFF
from damageest.stages.align.handedness.mirror import MirrorTest, check_handedness
from damageest.stages.align.refine.check_pose import check_pose
from damageest.stages.align.refine.robust_fit import Fit, fit
from damageest.stages.align.surface.frame import Frame
from damageest.stages.align.surface.oriented_points import draw_evenly, orient_scan, orient_surface
from damageest.stages.align.symmetry.prepare_part import prepare_part
from damageest.stages.align.wear.check_worn import check_with_wear, measure_given_wear

REACH = 0.04
"""How far off a given pose may be for the pose nearby to be found, in diagonals of the part."""

POINTS = 15_000
"""Number of scan points that the pose nearby is fitted to."""

SMALL_GAIN = 0.03
"""Share of the scan that lies on the part only in the pose nearby from which the given one is doubtful."""

ALL = 0.98
"""Share of the scan on the part in the pose nearby from which that pose explains all of it."""

MIN_GAIN, MIN_BESIDE, LARGE_GAIN = 0.05, 0.02, 0.4
"""Shares of the scan that have to lie on the part in the pose nearby and not in the given one, for it to be refused:
the first, with the second beside the part in the given pose, where no damage explains it; or the third alone."""

TRIALS = 60_000
"""Number of candidate poses of the mirrored scan, where the given pose agrees badly with the part."""
LEAST_ORIENTED = 10
"""Points with a clear normal below which no mirror image can be searched for."""


def check_given(T: Floats, scan: Scan, part: Part, tolerance: float) -> tuple[Reason, ...]:
    """What is doubtful about a pose ``T`` (4,4).

    Raises StageError where the scan does not lie on the part, where a pose nearby, found by the robust fit, explains it
    much better, and where it is a mirror image of the part. Damage and wear are no reason: in the given pose they lie
    inside the part, and in the pose nearby as well. A correction that moves the part's surface by less than the
    tolerance is not counted either.
    """
    frame = Frame.build(scan, part, T)
    noise, band = scan.noise / frame.size, tolerance / frame.size
    rng = np.random.default_rng(0)
    dense, weights, oriented = orient_scan(frame.scale_points(scan), scan.normals, noise, 100, rng)
    points = rng.permutation(dense[draw_evenly(dense, weights, POINTS, rng)])
    start = frame.scale_pose(T)
    near = fit(frame.target, points, start, max(REACH, 2 * band), noise, 60)
    worn = measure_given_wear(frame.target, start, points, noise, band)
    given = check_with_wear(frame.target, Fit(start, near.band, 0.0), points, dense, band, worn)
    fitted = check_pose(frame.target, near, points, dense, band)

    D = near.pose @ np.linalg.inv(start)
    surface = orient_surface(frame.target.known, 3000, rng).points
    moved = float(np.quantile(np.abs(frame.target.closest(move_points(surface, D))[0]), 0.98)) * frame.size
    gain, beside = fitted.on - given.on, given.beside - fitted.beside
    differs = fitted.is_acceptable and moved > tolerance
    if differs and (gain > LARGE_GAIN or (gain > MIN_GAIN and beside > MIN_BESIDE)):
        shift = float(np.linalg.norm(D[:3, 3])) * frame.size
        turn = float(np.degrees(Rotation.from_matrix(D[:3, :3]).magnitude()))
        raise StageError(
            f"in the given pose {given.on:.0%} of the scan lies on the part; moved by {shift:.3g} {part.unit} and "
            f"turned by {turn:.2g} degrees, {fitted.on:.0%} would: the pose is wrong, the part bent, or the scan "
            "scaled",
            "use align: icp, or give the right T_part_scan",
            topic="pose",
        )
    if not given.is_acceptable:
        raise StageError(
            f"the scan does not lie on the part in the given pose: {given.describe()}",
            "use align: register, or give the right T_part_scan; check unit and part",
            topic="pose",
        )
    doubts = given.note_doubts()
    is_off = given.beside > MIN_BESIDE and given.agreement < 1 - LEAST_OFF  # metal outside: no damage puts it there
    if is_off and len(oriented.points) >= LEAST_ORIENTED:
        test = MirrorTest(prepare_part(frame.target, 0), oriented, points, dense, noise, band, TRIALS)
        doubts += check_handedness(test, Fit(start, near.band, 0.0), given, rng).doubts
    if differs and gain > SMALL_GAIN:
        text = (
            f"in a pose that moves the part's surface by {moved:.3g} {part.unit}, {fitted.on:.0%} of the scan lies on "
            f"the part, in the given one {given.on:.0%}: wear or a wrong pose"
        )
        # the pose was given, and wear explains it as well: it is told. Where the pose nearby leaves nothing off the
        # part, it contradicts sites that are no deeper than it moves the skin: in it, no metal is lost there
        effect: Effect = "contradicts" if fitted.on > ALL else "open"
        doubts += (Reason("given_pose", text, effect, moved, part.unit, remedy="if the pose is wrong, use align: icp"),)
    return doubts
