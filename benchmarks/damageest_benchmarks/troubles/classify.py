"""Right, inside its interval, said, or silent: the definition, applied to one run. It reads values, and no sentence."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from damageest_evaluate.scores import MATCH, measure_depth, measure_pose_error, sample_surface, score, unite_solids

from damageest.artefacts import Floats, Part, Pose, Solid
from damageest.findings import Coverage
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.solids import to_manifold, to_solid
from damageest.geometry.transforms import move_mesh, move_points
from damageest.result import Result, Site

RIGHT_IOU = 0.9
"""Least intersection over union of the accepted damage volumes and the true damage."""
SMALL = 4.0
"""Damage with a volume below (4 tolerances)^3 is tiny, and damage no deeper than 4 tolerances is shallow: IoU says
little about it. Tiny damage may be missed."""
VOLUME_ERROR = 0.3
SURFACE_ERROR = 0.5
"""Tiny or shallow damage is right with this relative error of its volume, or with this volume of the symmetric
difference over the area of its inner surface, in tolerances."""
UNSEEN_SHARE = 0.5
"""Share of the skin of a damage that has to be reported as unseen for the damage to count as unseen."""

TOUCH = 1e-3
"""Share of a damage inside doubtful sites from which they are about this damage."""

Outcome = Literal["right", "inside", "said", "silent"]


@dataclass(frozen=True, eq=False)
class TrueState:
    """The truth of a run.

    ``pose`` (4,4) T_part_scan, None where no pose is right; ``damage`` in the part's frame. ``tolerance``: the one that
    the scan allows; a larger one of the job does not make damage tiny or a pose right. ``deform``: where places (N,3)
    of the part as designed are in the scanned one; None where it is not deformed.
    """

    part: Part
    damage: Solid | None
    pose: Floats | None
    tolerance: float = float("inf")
    deform: Callable[[Floats], Floats] | None = None


@dataclass(frozen=True)
class Group:
    """Sites and bodies of the true damage that overlap. ``truth``: volume of the bodies; ``volume``: of the accepted
    sites; ``low``, ``high``: their interval, to which doubtful sites of the group add; ``levels``: of all its sites."""

    truth: float
    volume: float
    low: float
    high: float
    levels: tuple[str, ...]
    accepted: int

    @property
    def holds(self) -> bool:
        """Whether the truth lies in the interval."""
        return self.low <= self.truth <= self.high


@dataclass(frozen=True)
class Judgement:
    """The outcome of a run and why.

    `right`: pose, sites and volumes. `inside`: a volume is wrong, and the truth lies in its interval. `said`: what is
    wrong is in doubtful sites, on skin reported as lost, or the run gave no interval of the total or was refused.
    `silent`: anything else. ``unseen``: number of true damages that lie on skin reported as unseen. ``iou``: of the
    accepted volumes and the true damage that is not unseen, NaN where there is neither. ``cautious``: it would be
    right with its doubtful sites accepted. ``refused``: the run gave an error. ``groups``: what overlaps.
    """

    outcome: Outcome
    reason: str
    iou: float = float("nan")
    unseen: int = 0
    cautious: bool = False
    refused: bool = False
    groups: tuple[Group, ...] = ()


def judge_error(message: str) -> Judgement:
    """The judgement on a run that was refused: it claims nothing."""
    return Judgement("said", f"refused: {message}", refused=True)


def judge(result: Result, true: TrueState) -> Judgement:
    """The judgement on a run that gave a result."""
    tolerance = min(result.tolerance, true.tolerance)
    if result.adapted is not None and true.deform is not None and true.pose is not None:
        true, motion = _follow(result, true, true.deform, true.pose, tolerance)
    else:
        motion = None if true.pose is None else find_motion(true.part, result.pose, true.pose, tolerance)
    bodies = _split_damage(true, motion)
    reported = {id(body): _find_report(body, result) for body in bodies}
    unseen = [body for body in bodies if reported[id(body)] == "unseen"]
    lost = [body for body in bodies if reported[id(body)] == "lost"]
    seen = _leave_out(bodies, unseen)
    accepted = [site.damage for site in result.sites if site.accepted]
    doubtful = [site.damage for site in result.sites if not site.accepted]
    faults = [] if motion is not None else ["the pose is wrong"]
    faults += find_faults(accepted, seen, unseen, true.part, tolerance)
    value = _compare(accepted, seen, true.part, tolerance)[0]
    if motion is None:
        open_end = result.volume_95 is None
        outcome: Outcome = "silent" if accepted or not (doubtful or lost or open_end) else "said"
        return Judgement(outcome, "; ".join(faults), value, len(unseen))
    groups = find_groups(result, bodies)
    if not faults:
        return Judgement("right", "", value, len(unseen), groups=groups)
    why = "; ".join(faults)
    taken = [group for group in groups if group.accepted]
    missed = [body for body in seen if body.volume > (SMALL * tolerance) ** 3 and not _is_told(body, result, lost)]
    cautious = bool(doubtful) and not find_faults([*accepted, *doubtful], seen, unseen, true.part, tolerance)
    low, high = result.volume_95 or (0.0, float("inf"))  # without one, more may be lost than was found
    is_unknown = low <= sum(body.volume for body in seen) <= high
    if (missed and not is_unknown) or any(not group.holds for group in taken):
        outcome = "silent"
    elif missed or lost or any("doubtful" in group.levels for group in groups):
        outcome = "said"
    else:
        outcome = "inside"
    return Judgement(outcome, why, value, len(unseen), cautious, groups=groups)


def _is_told(body: Solid, result: Result, lost: Sequence[Solid]) -> bool:
    """Whether a body of the true damage is in a site, also a doubtful one, or on skin that is reported as lost."""
    return any(body is one for one in lost) or _share_inside(body, [site.damage for site in result.sites]) > TOUCH


def find_groups(result: Result, bodies: Sequence[Solid]) -> tuple[Group, ...]:
    """The sites of a result with the bodies of the true damage that they overlap, those that overlap together."""
    from scipy.cluster.hierarchy import DisjointSet

    sites = result.sites
    joined = DisjointSet([*(("site", k) for k in range(len(sites))), *(("body", k) for k in range(len(bodies)))])
    for k, site in enumerate(sites):
        for number, body in enumerate(bodies):
            if _share_inside(body, [site.damage]) > TOUCH or _share_inside(site.damage, [body]) > MATCH:
                joined.merge(("site", k), ("body", number))
    return tuple(
        _make_group(
            [sites[k] for kind, k in sorted(subset) if kind == "site"],
            sum(bodies[k].volume for kind, k in subset if kind == "body"),
        )
        for subset in joined.subsets()
        if any(kind == "site" for kind, _ in subset)
    )


def _make_group(sites: Sequence[Site], truth: float) -> Group:
    taken = [site for site in sites if site.accepted]
    known = [site.volume_95 or (site.damage.volume,) * 2 for site in taken]
    more = sum(site.volume_95[1] if site.volume_95 else float("inf") for site in sites if not site.accepted)
    return Group(
        truth,
        sum(site.damage.volume for site in taken),
        sum(low for low, _ in known),
        sum(high for _, high in known) + more,
        tuple(sorted({site.verdict.level for site in sites})),
        len(taken),
    )


def find_faults(
    accepted: Sequence[Solid], seen: Sequence[Solid], unseen: Sequence[Solid], part: Part, tolerance: float
) -> list[str]:
    """What is wrong about the accepted damage volumes; nothing where they are right.

    ``seen``, ``unseen``: the bodies of the true damage; only those seen have to be found.
    """
    every = [*seen, *unseen]
    faults = []
    false = [solid for solid in accepted if _share_inside(solid, every) < MATCH]
    if false:
        faults.append(f"{len(false)} false sites with {sum(solid.volume for solid in false):.3g} in volume")
    large = [body for body in seen if body.volume > (SMALL * tolerance) ** 3]
    missed = [body for body in large if _share_inside(body, accepted) < MATCH]
    if missed:
        faults.append(f"{len(missed)} damages missed with {sum(body.volume for body in missed):.3g} in volume")
    if faults:
        return faults
    # a found body that is partly reported as unseen counts in full where it was found
    wanted = [*seen, *(body for body in unseen if _share_inside(body, accepted) >= MATCH)]
    if accepted and wanted:
        value, volume, surface, is_small = _compare(accepted, wanted, part, tolerance)
        good = value >= RIGHT_IOU
        if not good and is_small:
            good = abs(volume) <= VOLUME_ERROR or surface < SURFACE_ERROR
        if not good:
            faults.append(f"IoU {value:.2f}, volume error {volume:+.0%}")
    return faults


def _compare(
    found: Sequence[Solid], wanted: Sequence[Solid], part: Part, tolerance: float
) -> tuple[float, float, float, bool]:
    """IoU, relative error of the volume, error over the surface in tolerances, and whether it is tiny or shallow."""
    if not found or not wanted:
        return (float("nan") if not found and not wanted else 0.0), float("nan"), float("nan"), False
    whole = join(wanted)
    figures = score(part, found, whole, tolerance)
    tiny = whole.volume < (SMALL * tolerance) ** 3 or measure_depth(whole, part) <= SMALL * tolerance
    return figures.iou, figures.volume_error, figures.surface_error, tiny


def join(solids: Sequence[Solid]) -> Solid:
    """The union of solids. Raises ValueError where it is empty."""
    if len(solids) == 1:
        return solids[0]
    origin = solids[0].bounds.mean(axis=0)
    found = to_solid(unite_solids(solids, origin), origin)
    if found is None:
        raise ValueError("the union of the solids is empty")
    return found


def _share_inside(solid: Solid, others: Sequence[Solid]) -> float:
    """Share of a solid's volume inside others."""
    if not others:
        return 0.0
    origin = solid.bounds.mean(axis=0)
    return float((to_manifold(solid, origin) ^ unite_solids(others, origin)).volume() / solid.volume)


def find_motion(part: Part, found: Pose, true: Floats, tolerance: float) -> Floats | None:
    """The motion (4,4) of a symmetric part onto itself by which the found pose differs from the true one.

    The identity where the pose is right as it is; None where it is wrong. A pose is right within two tolerances (rms
    over the part's surface), if need be after motions that the result calls free, between their ends. On a symmetric
    part the true pose has to be among the alternatives, or, where the symmetry is continuous, a note has to name it.
    """
    return next((motion for error, motion in list_pose_errors(part, found, true) if error < 2 * tolerance), None)


def list_pose_errors(part: Part, found: Pose, true: Floats) -> Iterator[tuple[float, Floats]]:
    """What the found pose is off by, rms over the part's surface, and the motion (4,4) of the part onto itself with
    which it is so: without one, with each alternative of the result, and, where it names a symmetry, with any."""
    residual, path = measure_pose_error(part, found.T_part_scan, true)
    yield min(path, _measure_left(part, found, found.T_part_scan, true)), np.eye(4)
    for other in () if found.alternatives is None else found.alternatives:
        left = min(measure_pose_error(part, other, true)[1], _measure_left(part, found, other, true))
        yield left, np.asarray(found.T_part_scan @ np.linalg.inv(other))
    if any("symmetry" in note for note in found.notes):
        yield residual, np.asarray(found.T_part_scan @ np.linalg.inv(true))


def _follow(
    result: Result, true: TrueState, deform: Callable[[Floats], Floats], pose: Floats, tolerance: float
) -> tuple[TrueState, Floats | None]:
    """The truth of a deformed part for a result with an adapted one, and the motion (4,4) between their frames; None
    where the adapted part is another than the deformed one: its surface has to be that within a tolerance (rms)."""
    motion: Floats = np.asarray(result.pose.T_part_scan @ np.linalg.inv(pose))
    skin = move_points(deform(sample_surface(true.part, 4000)[0]), motion)
    off = float(np.sqrt((distance_to_mesh(skin, result.part) ** 2).mean()))
    damage = None if true.damage is None else Solid(deform(true.damage.vertices), true.damage.faces)
    return replace(true, part=result.part, damage=damage), motion if off < tolerance else None


def _measure_left(part: Part, found: Pose, T: Floats, true: Floats) -> float:
    """The rms path by which a pose ``T`` (4,4) differs from the true one after the best of its free motions."""
    if not found.free:
        return float("inf")
    points = sample_surface(part, 4000)[0]
    moved = move_points(points, T @ np.linalg.inv(true))
    ways = np.stack([one.move(moved).ravel() for one in found.free], axis=1)
    best = np.linalg.lstsq(ways, (points - moved).ravel(), rcond=None)[0]
    amount = np.clip(best, [one.low for one in found.free], [one.high for one in found.free])
    left = (moved - points).ravel() + ways @ amount
    return float(np.sqrt((left**2).sum() / len(points)))


def _split_damage(true: TrueState, motion: Floats | None) -> list[Solid]:
    """The connected bodies of the true damage, where the found pose puts them on a symmetric part."""
    if true.damage is None:
        return []
    damage = move_mesh(true.damage, motion)
    origin = damage.bounds.mean(axis=0)
    pieces = [to_solid(piece, origin) for piece in to_manifold(damage, origin).decompose()]
    return [piece for piece in pieces if piece is not None]


def _find_report(body: Solid, result: Result) -> Literal["unseen", "lost", ""]:
    """What the result reports of most of a damage's skin: unseen, or lost as rays passed through it; empty: neither."""
    coverage = result.coverage
    if coverage is None or not len(coverage.skin.faces):
        return ""
    points = sample_by_area(body, 2000, np.random.default_rng(3))[0]
    # not exactly on it: the pose that moved the body has an error
    skin = points[distance_to_mesh(points, result.part) < 0.1 * result.tolerance]
    if not len(skin):
        return ""
    cell = closest_on_mesh(skin, coverage.skin)[1]
    lost = float(coverage.is_lost[cell].mean())
    both = float((coverage.is_lost[cell] | (coverage.region[cell] >= 0)).mean())
    if both < UNSEEN_SHARE:
        return ""
    return "lost" if lost > both / 2 else "unseen"


def _leave_out(bodies: Sequence[Solid], others: Sequence[Solid]) -> list[Solid]:
    return [body for body in bodies if not any(body is other for other in others)]


def measure_seen_error(coverage: Coverage | None, seen: float) -> float | None:
    """Difference between reported and true share of seen skin, in points of per cent; None without a report."""
    return None if coverage is None else 100 * abs(coverage.seen - seen)
