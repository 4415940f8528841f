"""Whether a scan of another scale explains the part: a wrong unit, a scanner that was not calibrated, shrinkage."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import Floats, Reason
from damageest.errors import StageError
from damageest.geometry.transforms import make_motions, move_points
from damageest.stages.align.handedness.mirror import MirrorTest, measure_share_on
from damageest.stages.align.refine.check_pose import DOUBTFUL_AGREEMENT, PoseCheck
from damageest.stages.align.refine.robust_fit import MAX_DRIFT, REACH, Fit, solve_gauss_newton
from damageest.stages.align.search.pairs import propose_poses
from damageest.stages.align.search.search import search
from damageest.stages.align.surface.oriented_points import OrientedPoints
from damageest.stages.align.surface.plane_grid import UNKNOWN
from damageest.stages.align.symmetry.choose import COARSE

ASKED = 0.95
"""Agreement of the pose from which no other scale is tried."""
GAIN = 0.1
"""Least gain of agreement for another scale to be the better one: what is lost seldom looks like another size."""
EXPLAINED = 0.9
"""Agreement that the scan has to have in another scale, for a pose that is acceptable as it is to be doubted."""
LEAST = 0.003
"""Change of the scale from which it is another one; smaller ones are told from how the intact skin deviates."""
STARTS = (1.0, 0.93, 1.07)
"""Changes of the scale that the fits begin with, in the pose found, besides the one that the sizes tell."""
FAR = (0.5, 0.6, 0.72, 0.85, 0.92, 1.08, 1.18, 1.4, 1.7, 2.0)
"""Scales that poses are searched for with from the beginning, where no pose is acceptable."""
POINTS, ROUNDS, TRIALS = 2000, 25, 20_000


@dataclass(frozen=True)
class OtherScale:
    """A ``scale`` by which the scan has to be multiplied to lie on the part, and how well it explains the scan then."""

    scale: float
    check: PoseCheck

    def describe(self, before: PoseCheck) -> str:
        """The finding in words."""
        percent = 100 * (1 / self.scale - 1)
        size = f"{abs(percent):.3g} % {'larger' if percent > 0 else 'smaller'}"
        return (
            f"the scale is wrong: the scan is {size} than the part; multiplied by {self.scale:.4g}, "
            f"{self.check.agreement:.0%} of it near the part lies on the surface, as it is {before.agreement:.0%}"
        )

    def make_doubt(self, before: PoseCheck) -> Reason:
        """The doubt about a pose that is acceptable all the same."""
        return Reason("wrong_scale", self.describe(before), "contradicts", self.scale, remedy=REMEDY)

    def build_error(self, before: PoseCheck) -> StageError:
        """The error for a pose that is not acceptable."""
        return StageError(self.describe(before), REMEDY, topic="form")


REMEDY = "check units, the scanner's calibration and the revision of the CAD; export the scan again in the right size"


def check_scale(test: MirrorTest, best: Fit, check: PoseCheck, rng: np.random.Generator) -> OtherScale | None:
    """The scale in which the scan explains the part far better than in its pose ``best``; None where there is none.

    A scan that is damaged lies off the part where metal is lost, one of another size nearly everywhere.
    """
    if check.agreement >= ASKED:
        return None
    at = move_points(test.points[:POINTS], best.pose)
    ratio = _compare_sizes(test, at)
    begun = [make_scaling(start, at.mean(axis=0)) @ best.pose for start in (*STARTS, ratio)]
    if abs(np.log(ratio)) > 0.02:
        begun.append(_search_scaled(test, ratio, rng))
    pose, share = _choose(test, begun, best.band)
    if share < EXPLAINED and not check.is_acceptable:  # it is refused in any case: there is time
        far, of_far = _choose(test, [_search_scaled(test, scale, rng) for scale in FAR], best.band)
        pose = far if of_far > share else pose
    scale = float(np.cbrt(np.linalg.det(pose[:3, :3])))
    if abs(np.log(scale)) < LEAST:
        return None
    found = OtherScale(scale, test.check(replace(best, pose=pose), best.band))
    wanted = EXPLAINED if check.is_acceptable else DOUBTFUL_AGREEMENT
    is_better = found.check.agreement > max(wanted, check.agreement + GAIN)
    return found if is_better and found.check.is_acceptable else None


def _choose(test: MirrorTest, begun: list[Floats], band: float) -> tuple[Floats, float]:
    """The best of the fits that begin with poses (4,4), and the share of the points that it puts on the part."""
    fits = [_fit_scaled(test, pose) for pose in begun]
    shares = [measure_share_on(test, pose, band) for pose in fits]
    best = int(np.argmax(shares))
    return fits[best], shares[best]


def make_scaling(scale: float, middle: Floats) -> Floats:
    """The motion (4,4) that multiplies lengths by a scale about ``middle`` (3,)."""
    T = np.diag([scale, scale, scale, 1.0])
    T[:3, 3] = (1 - scale) * middle
    return T


def _compare_sizes(test: MirrorTest, at: Floats) -> float:
    """What the scan's points (N,3), in their pose, have to be multiplied by to be as large as the part: the median over
    its three axes."""
    vertices = test.part.surface.mesh.vertices
    return float(np.median(np.ptp(vertices, axis=0) / np.maximum(np.ptp(at, axis=0), 1e-9)))


def _search_scaled(test: MirrorTest, scale: float, rng: np.random.Generator) -> Floats:
    """The best pose (4,4) of the scan multiplied by a scale, searched for from the beginning; it contains the scale."""
    scan = OrientedPoints(test.oriented.points * scale, test.oriented.normals, test.oriented.signed)
    trials = min(TRIALS, test.trials)
    pose = search(propose_poses(scan, test.part.pairs, trials, rng), scan, test.part.grid, rng)[0]
    return np.asarray(pose @ make_scaling(scale, np.zeros(3)))


def _fit_scaled(test: MirrorTest, pose: Floats) -> Floats:
    """The similarity (4,4) that fits the scan best, from ``pose`` (4,4) on, which may contain a scale."""
    points, target = test.points[:POINTS], test.part.surface
    width, narrowest, drift = 3 * COARSE, max(REACH * test.noise, 2e-5), np.inf
    for _ in range(ROUNDS):
        at = move_points(points, pose)
        if drift > MAX_DRIFT * width:
            distance, foot, face = target.closest(at)
            normals, drift = target.normals[face], 0.0
            offset = np.einsum("ij,ij->i", normals, at - foot)
        else:  # along the planes of the places that were found last
            before, offset = offset, np.einsum("ij,ij->i", normals, at - foot)
            distance = distance + offset - before
        within = (np.abs(distance) < width) & (distance > UNKNOWN)
        if within.sum() < 12:
            break
        weight = (1 - (distance[within] / width) ** 2) ** 2
        middle = at[within].mean(axis=0)
        twist, grows = _solve(at[within], normals[within], weight, offset[within], middle)
        pose = make_motions(twist[None])[0] @ make_scaling(1 + grows, middle) @ pose
        step = float(np.hypot(np.linalg.norm(twist[:3]) / 2, np.linalg.norm(twist[3:]))) + abs(grows) / 2
        drift += step
        deviation = 1.4826 * float(np.median(np.abs(distance[within])))
        narrower = min(width, max(REACH * deviation, 0.8 * width, narrowest))
        if step < 0.003 * narrowest and narrower > 0.97 * width:
            break
        width = narrower
    return pose


def _solve(at: Floats, normals: Floats, weight: Floats, offset: Floats, middle: Floats) -> tuple[Floats, float]:
    """One step of rigid motion, a twist (6,), and of scale about ``middle`` (3,), both solved together: the part of the
    scale's effect that a motion has too is taken out of it first."""
    growth = np.einsum("ij,ij->i", normals, at - middle)
    twist, jacobian = solve_gauss_newton(at, normals, weight, offset)
    alike, _ = solve_gauss_newton(at, normals, weight, growth)
    own, left = growth + jacobian @ alike, offset + jacobian @ twist
    grows = -float((weight * own * left).sum() / max(float((weight * own * own).sum()), 1e-12))
    grows = float(np.clip(grows, -0.05, 0.05))
    return np.asarray(twist + grows * alike), grows
