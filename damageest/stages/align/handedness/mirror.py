"""Whether a scan shows the mirror image of the part, as a left-hand part scanned for a right-hand one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from damageest.artefacts import Floats, Reason
from damageest.errors import StageError
from damageest.geometry.transforms import move_points
from damageest.stages.align.datum.last_fit import FIRST
from damageest.stages.align.handedness.normals import measure_inward
from damageest.stages.align.refine.check_pose import DOUBTFUL_AGREEMENT, NEAR, PoseCheck, check_pose
from damageest.stages.align.refine.robust_fit import Fit, fit, fit_each
from damageest.stages.align.search.pairs import propose_poses
from damageest.stages.align.search.search import KEPT, search
from damageest.stages.align.search.weigh_poses import DECISIVE, weigh_poses
from damageest.stages.align.surface.oriented_points import OrientedPoints
from damageest.stages.align.symmetry.choose import COARSE
from damageest.stages.align.symmetry.prepare_part import PreparedPart
from damageest.stages.align.symmetry.symmetries import make_reflections

POINTS = 2500
"""Number of scan points that mirrored poses are compared with."""

FEWER = 3
"""Of so many candidate poses one is tried where the scan is searched for anew: all that counts is whether it fits."""

FITTED = 3
"""Number of mirror planes of each point whose poses are fitted."""

LESS, FAR_LESS, LARGE_GAIN = 0.6, 0.35, 0.04
"""For the mirrored scan to be the better one, or by far the better one: the share of the points off the part that it
may keep; or the share of the points near the part that lies on it only where the scan is mirrored."""

SUSPECT = 0.82
"""Share of the points near the part on its surface below which poses are searched for from the beginning once more, of
the mirrored scan and of the unmirrored one."""

MIN_GAIN = 0.015
"""Least such share in any case. Where less of the scan is off the part, it is not searched for mirrored."""

SYMMETRIC, OFF = 0.005, 0.004
"""Share of the skin seen that a reflection may take off the part, by more than the second, for it to be symmetric: then
a scan and its mirror image show the same."""

WIDELY = 0.6
"""Share of the part's surface that a mirrored scan covers, from which the share that it may keep off the part does not
count: lost metal is off the part either way."""

WHOLE = 0.7
"""Share of the part's surface that a mirrored scan covers, from which skin that is symmetric explains it no more."""

PART, HUGE_GAIN = 0.4, 0.06
"""The same where the mirrored scan lies on the part better by the second: whether skin is symmetric cannot be asked of
what both explain, and what only one explains is so much."""

LITTLE = 0.3
"""Share of the part's surface below which a scan that fits better mirrored is doubted and not refused: a few faces have
a mirror image that fits another place of the part."""


INWARD = 0.9
"""Share of the scan's normals from which they point into the part."""

NONE = np.zeros((0, 4, 4))
"""No pose."""


@dataclass(frozen=True)
class MirrorTest:
    """What poses of a scan and of its mirror image are found and compared with.

    ``points`` (N,3): spread evenly over the scan, in random order; ``raw`` (M,3): any unbiased subset of it;
    ``oriented``: oriented points of it; ``noise``, ``tolerance`` in diagonals; ``trials``: number of candidate poses;
    ``has_normals``: whether the signs of their normals are those of the scan's own.
    """

    part: PreparedPart
    oriented: OrientedPoints
    points: Floats
    raw: Floats
    noise: float
    tolerance: float
    trials: int
    has_normals: bool = False

    def check(self, pose: Fit, band: float) -> PoseCheck:
        """How well a pose explains the scan, with points on the part up to one and the same ``band`` from it."""
        return check_pose(self.part.surface, replace(pose, band=band), self.points, self.raw, self.tolerance)

    def weigh(self, pose: Fit, other: Fit) -> float:
        """As `weigh_poses`, over one other pose."""
        return float(weigh_poses(self.part.surface, self.points, pose.pose, other.pose[None], self.noise)[0])


@dataclass(frozen=True)
class Handedness:
    """The outcome of the test: a pose of the unmirrored scan that explains it better than the one given, or None, and
    ``others`` (K,4,4) that the scan does not exclude beside it, and ``doubts`` for the user."""

    better: Fit | None = None
    others: Floats = field(default_factory=lambda: NONE)
    doubts: tuple[Reason, ...] = ()


def check_handedness(test: MirrorTest, best: Fit, check: PoseCheck, rng: np.random.Generator) -> Handedness:
    """Compares the scan in its pose ``best`` with its mirror image, which is fitted no harder than the scan itself.

    Of a part that a plane mirrors onto itself there is nothing to ask. Raises StageError where the scan shows enough of
    the part and is a mirror image of it.
    """
    if check.agreement >= SUSPECT and test.part.is_mirror_symmetric:
        return Handedness()
    proper: list[Fit] = []
    if check.agreement < SUSPECT:
        proper, mirrored = [_search_again(test, rng, 1.0)], _search_again(test, rng, -1.0)
    else:
        tried = [*_fit_reflections(test, best), _search_again(test, rng, -1.0)]
        mirrored = max(tried, key=lambda one: measure_share_on(test, one.pose, best.band))
    of_mirrored = test.check(mirrored, best.band)
    if _is_better(of_mirrored, check):
        # a mirror image of the mirrored scan is a pose of the scan: of skin that is symmetric it fits as well
        proper += _fit_reflections(test, mirrored)
        if _is_far_better(of_mirrored, check) and check.agreement >= SUSPECT:
            proper.append(_search_again(test, rng, 1.0))  # as hard as the mirrored one was
    result = Handedness()
    if proper:
        found = max(proper, key=lambda one: measure_share_on(test, one.pose, best.band))
        of_found = test.check(found, best.band)
        if of_found.agreement > check.agreement + MIN_GAIN:
            is_open = test.weigh(found, best) < DECISIVE and check.is_acceptable
            result = Handedness(found, best.pose[None] if is_open else NONE)
            best, check = found, of_found
    if not (of_mirrored.is_acceptable and _is_better(of_mirrored, check)):
        return result
    # of skin that the scan shows nearly whole, a pose that were as good unmirrored would have been found
    gain = of_mirrored.agreement - check.agreement
    is_whole = of_mirrored.cover > (PART if gain > HUGE_GAIN else WHOLE) and _is_far_better(of_mirrored, check)
    if not is_whole and _shows_symmetric(test, best, mirrored):
        return result
    if test.weigh(mirrored, best) < DECISIVE:
        return result
    if check.cover < LITTLE and of_mirrored.cover < LITTLE:
        return replace(result, doubts=(_describe_doubt(check, of_mirrored),))
    raise _build_error(check, of_mirrored, _describe_which(test, mirrored.pose))


def _is_better(mirrored: PoseCheck, check: PoseCheck) -> bool:
    """Whether the mirrored scan lies on the part clearly better than the unmirrored one."""
    gain = mirrored.agreement - check.agreement
    is_less = 1 - mirrored.agreement < LESS * (1 - check.agreement) or mirrored.cover > WIDELY
    return gain > LARGE_GAIN or (gain > MIN_GAIN and is_less)


def _is_far_better(mirrored: PoseCheck, check: PoseCheck) -> bool:
    """Whether it lies on the part so much better that skin which is nearly symmetric does not explain it."""
    gain = mirrored.agreement - check.agreement
    return gain > LARGE_GAIN or (gain > MIN_GAIN and 1 - mirrored.agreement < FAR_LESS * (1 - check.agreement))


def _fit_reflections(test: MirrorTest, best: Fit) -> list[Fit]:
    """Fits of the scan, mirrored from its pose ``best``, at planes that contain the direction of an axis of the part's
    frame, through the part's middle and through that of the skin seen. Where ``best`` mirrors the results do not.

    A part that nearly has such a plane of symmetry fits its mirror image nearly as well; its holes and bosses do not.
    """
    target, grid = test.part.surface, test.part.grid
    at = move_points(test.points[:POINTS], best.pose)
    few = at[:1500]
    tried: list[Floats] = []
    for middle in (np.zeros(3), np.median(few, axis=0)):
        mirrors = make_reflections(middle)
        on = [float((np.abs(grid.estimate_distance(move_points(few, one))) < COARSE).mean()) for one in mirrors]
        tried.extend(mirrors[np.argsort(-np.array(on), kind="stable")[:FITTED]])
    moved = [move_points(at, mirror) for mirror in tried]
    fits = fit_each(target, moved, [np.eye(4)] * len(tried), 3 * COARSE, test.noise, 30)
    return [replace(one, pose=one.pose @ mirror @ best.pose) for one, mirror in zip(fits, tried, strict=True)]


def _search_again(test: MirrorTest, rng: np.random.Generator, side: float) -> Fit:
    """The best fit of the scan, searched for from the beginning; mirrored where ``side`` is -1. The ``pose`` of the
    result mirrors then."""
    flip = np.array([1.0, 1.0, side])
    scan = test.oriented
    mirrored = OrientedPoints(scan.points * flip, scan.normals * flip, scan.signed)
    rough = propose_poses(mirrored, test.part.pairs, test.trials // FEWER, rng)
    pose = search(rough, mirrored, test.part.grid, rng, (KEPT[0] // FEWER, KEPT[1] // FEWER))[0]
    found = fit(test.part.surface, test.points[:FIRST] * flip, pose, COARSE, test.noise, 30)
    return replace(found, pose=found.pose @ np.diag([*flip, 1.0]))


def measure_share_on(test: MirrorTest, pose: Floats, band: float) -> float:
    """The share of the points that a pose (4,4) puts on the part."""
    distance = test.part.surface.closest(move_points(test.points[:POINTS], pose))[0]
    return float((np.abs(distance) < band).mean())


def _shows_symmetric(test: MirrorTest, best: Fit, mirrored: Fit) -> bool:
    """Whether the skin that the scan shows in the pose ``best`` has a mirror image on the part where ``mirrored`` has
    the scan: then a scan and its mirror image show the same."""
    target = test.part.surface
    distance, seen, _ = target.closest(move_points(test.points[:POINTS], best.pose))
    seen = move_points(seen[np.abs(distance) < NEAR], mirrored.pose @ np.linalg.inv(best.pose))
    if not len(seen):
        return True
    # Fitted: the reflection of a scan with damage is inexact, and the skin may be symmetric by one nearby.
    onto = fit(target, seen, np.eye(4), 3 * COARSE, 1e-5, 30).pose
    return bool((np.abs(target.closest(move_points(seen, onto))[0]) > OFF).mean() < SYMMETRIC)


def _describe_doubt(check: PoseCheck, mirrored: PoseCheck) -> Reason:
    text = (
        f"{mirrored.agreement:.0%} of the scan near the part lies on its surface when mirrored, "
        f"{check.agreement:.0%} as it is: a mirrored part? It covers only {check.cover:.0%} of the surface"
    )
    return Reason("mirrored", text, "contradicts", mirrored.agreement, remedy="scan more of the part")


def _describe_which(test: MirrorTest, pose: Floats) -> str:
    """Which file was mirrored, where the scan's own normals tell: a program that mirrors points and leaves the order of
    each triangle's corners turns them inward. Empty where they do not; ``pose`` (4,4) mirrors."""
    scan = test.oriented
    if not test.has_normals or measure_inward(test.part.surface, scan.points, scan.normals, pose, COARSE) < INWARD:
        return ""
    return ". Its normals point inward then: the scan was mirrored, not the part"


def _build_error(check: PoseCheck, mirrored: PoseCheck, which: str) -> StageError:
    if mirrored.agreement < DOUBTFUL_AGREEMENT:
        return StageError(
            f"only {check.agreement:.0%} of the scan near the part lies on its surface, mirrored "
            f"{mirrored.agreement:.0%}: a mirrored, scaled, bent or other part",
            "scan: {scale: auto} if the scale may be wrong; otherwise check which part was scanned",
            topic="form",
        )
    return StageError(
        f"the scan is a mirror image of the part: mirrored, {mirrored.agreement:.0%} of it near the part lies on the "
        f"surface, as it is {check.agreement:.0%}{which}",
        "check for a left-hand and a right-hand version of the part, and for an axis that an export reversed",
    )
