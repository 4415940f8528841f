"""Chooses the pose that fits the scan best, and lists the others that fit as well."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats
from damageest.geometry.transforms import move_points
from damageest.stages.align.refine.robust_fit import fit, fit_each, robust_cost
from damageest.stages.align.search.search import refine, score, select_distinct
from damageest.stages.align.search.weigh_poses import DECISIVE, weigh_poses
from damageest.stages.align.surface.oriented_points import OrientedPoints
from damageest.stages.align.surface.plane_grid import PartSurface, PlaneGrid
from damageest.stages.align.symmetry._counterparts import turn_poses
from damageest.stages.align.symmetry._turns import Axis, find_common_axis, group_turns
from damageest.stages.align.symmetry.prepare_part import PreparedPart
from damageest.stages.align.symmetry.symmetries import measure_apart, pick_heads

MAX_POSES = 40
"""Largest number of poses fitted to the triangles: enough for a gear of twenty teeth, either way up."""

COARSE = 0.008
"""Width of the band, in diagonals, at which the fit changes from the grid to the triangles."""

FAR = 4 * COARSE
"""Distance, in diagonals, from which on the cost of a point no longer depends on its exact distance."""

APART = 0.02
"""Distance of two poses, in diagonals, below which they are counted once: copies that the fit cannot distinguish, or
one that slid a little."""

FIRST_POINTS, SECOND_POINTS, THIRD_POINTS = 1500, 4000, 10_000
"""Number of points for the first comparison of poses and the fits before it, and for those that follow: most poses that
are one tooth off are worse by then, and cost no more."""

MANY = 8
"""Number of poses from which on the symmetries of the part are asked for: to fit fewer costs less."""

RIVAL, MAX_RIVALS = 0.15, 8
"""How much more, for each point, a pose may cost than the best one for them to be compared by patches, and how
many are."""


@dataclass(frozen=True)
class Choice:
    """The best ``pose`` (4,4); the ``others`` (K,4,4) that fit as well; the ``axis`` about which the part may be turned
    by any angle, or None; the ``band``: distance within which a point lies on the surface."""

    pose: Floats
    others: Floats
    axis: Axis | None
    band: float

    @property
    def poses(self) -> Floats:
        """The pose and the others (K,4,4)."""
        return np.concatenate([self.pose[None], self.others])

    def keep(self, poses: Floats) -> Choice:
        """The choice with some of its poses (K,4,4), in their order."""
        return replace(self, pose=poses[0], others=poses[1:])


def choose_pose(poses: Floats, part: PreparedPart, scan: OrientedPoints, points: Floats, noise: float) -> Choice:
    """Fits the promising poses among ``poses`` (H,4,4), and these turned about a common axis, to the triangles and
    compares them point by point. Of poses that differ by a symmetry of the part two are fitted; the others follow.

    ``points`` (N,3): spread evenly over the scan and in random order, for the fit to the triangles. ``scan``: for the
    lookups in the grid. Lengths in diagonals of the part.
    """
    target, field = part.surface, part.grid
    poses, axis = _add_counterparts(poses, field, scan)
    if axis is not None:
        some = points[:THIRD_POINTS]
        head = fit(target, _keep_near(field, points[:FIRST_POINTS], poses[0]), poses[0], COARSE, noise, 12)
        cost = robust_cost(_measure_distance(target, field, some, head.pose), head.band)
        if _is_continuous(axis, head.pose, cost, target, field, some, noise, COARSE, head.band):
            # poses that differ by a turn fit alike: one of each set is enough, if all points agree in the end
            heads = poses[group_turns(poses, axis, 8)]
            found = _compare(heads, axis, target, field, points, noise)
            if found.axis is not None:
                return found
    poses = _put_copies_last(poses)[:MAX_POSES]
    together = np.concatenate([poses, turn_poses(poses, target, field, scan)])
    if len(together) < MANY:
        return _compare(together, axis, target, field, points, noise)
    heads = together[pick_heads(together, part.symmetries, APART, 2)]
    return _list_symmetric(_compare(heads, axis, target, field, points, noise), part.symmetries)


def _list_symmetric(choice: Choice, symmetries: Floats) -> Choice:
    """The choice with all poses that the symmetries (G,4,4) of the part make of its own."""
    if choice.axis is not None or len(symmetries) == 1:
        return choice
    every = (symmetries[None] @ choice.poses[:, None]).reshape(-1, 4, 4)
    order = -np.arange(len(every), dtype=np.float64)
    apart = min(APART, 0.5 * float(measure_apart(symmetries[1:], symmetries[0]).min()))
    return choice.keep(every[select_distinct(every, order, apart, len(every))])


def _compare(
    poses: Floats, axis: Axis | None, target: PartSurface, field: PlaneGrid, points: Floats, noise: float
) -> Choice:
    """The best of the poses (H,4,4), each fitted to the triangles, and the others that fit as well."""
    near = [_keep_near(field, points[:FIRST_POINTS], pose) for pose in poses]
    fits = fit_each(target, near, list(poses), COARSE, noise, 12)
    poses = np.array([one.pose for one in fits])
    distances = _measure_distances(target, field, points[:FIRST_POINTS], poses)
    band = fits[int(np.argmin([robust_cost(distance, 0.75 * COARSE).sum() for distance in distances]))].band
    costs = [robust_cost(distance, band) for distance in distances]
    first = select_distinct(poses, -np.array([cost.sum() for cost in costs]), 0.25 * COARSE, MAX_POSES)
    poses, costs = poses[first], [costs[k] for k in first]
    fitted, means = poses, np.array([cost.mean() for cost in costs])
    for start, stop in pairwise((FIRST_POINTS, SECOND_POINTS, THIRD_POINTS, len(points))):
        kept = np.flatnonzero(_select_equal(costs))
        poses, more = poses[kept], points[start:stop]
        added = [robust_cost(distance, band) for distance in _measure_distances(target, field, more, poses)]
        costs = [np.concatenate([costs[k], cost]) for k, cost in zip(kept, added, strict=True)]
    best = int(np.argmin([cost.sum() for cost in costs]))
    equal = np.array([not is_worse(cost, costs[best]) for cost in costs])
    pose, others = poses[best], poses[equal]
    order = np.array([cost.sum() for cost, same in zip(costs, equal, strict=True) if same])
    others = others[select_distinct(others, -order, max(APART, 6 * band), MAX_POSES)][1:]
    if axis is not None and not _is_continuous(axis, pose, costs[best], target, field, points, noise, 2 * band, band):
        axis = None
    if axis is not None:
        # The number of poses is infinite: of each set of poses that differ by a turn, list one and its quarter turns.
        candidates = np.concatenate([pose[None], others])
        heads = candidates[group_turns(candidates, axis, 8)]
        quarter = axis.make_turns(np.radians([0, 90.0, 180.0, 270.0]))
        others = (quarter[:, None] @ heads[None]).reshape(-1, 4, 4)[1:]
    rivals = fitted[means < means.min() + RIVAL]
    return Choice(pose, _add_rivals(pose, others, rivals, axis, target, points, noise, band), axis, band)


def _add_rivals(
    pose: Floats,
    others: Floats,
    rivals: Floats,
    axis: Axis | None,
    target: PartSurface,
    points: Floats,
    noise: float,
    band: float,
) -> Floats:
    """The ``others`` (K,4,4) and those of the ``rivals`` (R,4,4) that the scan does not exclude.

    On a part that is nearly symmetric, a scanner's steps and waves make a pose that is turned the better one as often
    as not, where only the sums of all points are compared.
    """
    known = np.concatenate([pose[None], others])
    together = np.concatenate([known, rivals])
    kept = select_distinct(together, -np.arange(len(together), dtype=np.float64), max(APART, 6 * band), MAX_POSES)
    rivals = together[kept[kept >= len(known)]][:MAX_RIVALS]
    if axis is not None and len(rivals):
        rivals = rivals[~np.array([axis.is_turn(known @ np.linalg.inv(one)).any() for one in rivals])]
    open_ = weigh_poses(target, points, pose, rivals, noise) < DECISIVE
    return np.concatenate([others, rivals[open_]])


def _is_continuous(
    axis: Axis,
    pose: Floats,
    cost: Floats,
    target: PartSurface,
    field: PlaneGrid,
    points: Floats,
    noise: float,
    start: float,
    band: float,
) -> bool:
    """Whether the points (N,3), of this cost (N,) in ``pose`` (4,4), fit as well turned about an axis by any angle.

    The turned poses are fitted, with a kernel that is ``start`` wide at first: the axis is only as exact as the poses
    that it was computed from.
    """
    few = points[:FIRST_POINTS]
    for turned in axis.make_turns(np.radians([1.3, 7.1, 17.9, 41.0, 97.0, 180.0, 263.0])) @ pose:
        fitted = fit(target, _keep_near(field, few, turned), turned, start, noise, 6).pose
        if is_worse(robust_cost(_measure_distance(target, field, points, fitted), band), cost):
            return False
    return True


def _keep_near(field: PlaneGrid, points: Floats, pose: Floats) -> Floats:
    """The points (N,3) that a pose puts near the surface; exact distances of the others are slow and not needed."""
    return points[np.abs(field.estimate_distance(move_points(points, pose))) < FAR]


def _measure_distance(target: PartSurface, field: PlaneGrid, points: Floats, pose: Floats) -> Floats:
    """As `_measure_distances`, in one pose (4,4)."""
    return np.asarray(_measure_distances(target, field, points, pose[None])[0])


def _measure_distances(target: PartSurface, field: PlaneGrid, points: Floats, poses: Floats) -> Floats:
    """Signed distances (H,N) of the points (N,3) in each of the poses (H,4,4): exact near the surface, from the grid
    far from it."""
    at = np.concatenate([move_points(points, pose) for pose in poses])
    distance = field.estimate_distance(at).astype(np.float64)
    near = np.abs(distance) < FAR
    distance[near] = target.closest(at[near])[0]
    return distance.reshape(len(poses), len(points))


def _add_counterparts(poses: Floats, field: PlaneGrid, scan: OrientedPoints) -> tuple[Floats, Axis | None]:
    """The promising poses, these poses turned about the axis by which they differ, and the axis, or None.

    A pose that is one tooth off differs from the right one only at a keyway, and the keyway of a shaft is a few degrees
    wide. The random search may miss it; steps of one degree do not.
    """
    poses, scores = _rank(poses, field, scan)
    poses = poses[_select_promising(scores)]
    axis = find_common_axis(poses)
    if axis is not None:
        heads = poses[group_turns(poses, axis, 4)]
        turned = (axis.make_turns(np.radians(np.arange(360)))[None] @ heads[:, None]).reshape(-1, 4, 4)
        turned = turned[select_distinct(turned, score(turned, scan, field, COARSE), 2 * COARSE, 2 * MAX_POSES)]
        turned = refine(turned, scan, field, np.geomspace(1.5 * COARSE, 0.75 * COARSE, 5))
        poses, scores = _rank(np.concatenate([poses, turned]), field, scan)
        poses = poses[_select_promising(scores)]
    return poses, axis


def _put_copies_last(poses: Floats) -> Floats:
    """The poses (H,4,4), those last that lie near a better one: they would crowd out the counterparts of a gear."""
    first = select_distinct(poses, -np.arange(len(poses), dtype=np.float64), APART, len(poses))
    return np.concatenate([poses[first], np.delete(poses, first, axis=0)])


def _rank(poses: Floats, field: PlaneGrid, scan: OrientedPoints) -> tuple[Floats, Floats]:
    scores = score(poses, scan, field, COARSE)
    order = select_distinct(poses, scores, 0.5 * COARSE, len(poses))
    return poses[order], scores[order]


def _select_promising(scores: Floats) -> NDArray[np.bool_]:
    best = float(scores.max())
    return np.asarray(scores >= best - max(0.06, 0.2 * best))


def _select_equal(costs: list[Floats]) -> NDArray[np.bool_]:
    """Which poses are not significantly worse than the best. ``costs``: for each pose, the cost of each point (N,)."""
    best = costs[int(np.argmin([cost.sum() for cost in costs]))]
    return np.array([not is_worse(cost, best) for cost in costs])


def is_worse(cost: Floats, best: Floats) -> bool:
    """Whether a pose with costs ``cost`` (N,) of the points is significantly worse than one with costs ``best`` (N,).

    Significantly: by more than chance (five standard errors), and by more than the errors of fit and tessellation.
    These are below 0.0001 per point on exactly symmetric parts; a keyway changes the cost by a hundred times that.
    """
    more = cost - best
    total = float(more.sum())
    return total > 0.0005 * len(more) and total > 5 * float(np.sqrt((more**2).sum()))
