"""How far the nozzle stays from what it must not touch.

Two measures. Bounds come from points that are spread over the obstacles: each stands for the surface within a known
distance of it, and its distance to a nozzle that is a solid of revolution follows from a formula, for many poses at
once. Where the bounds do not decide, the FCL library gives the exact distance between the triangles of both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.duplicates import list_distinct
from damageest.geometry.transforms import turn_to_axis
from damageest_paths.nozzle import Nozzle
from damageest_paths.obstacles import MEMBERS, Obstacles
from damageest_paths.sight import Beam

CHUNK = 1024
"""Poses that are bounded at once, so that intermediate arrays fit in the processor's cache."""
STRIDES = (16, 4, 1)
"""Of the poses of a pass, each sixteenth is measured first, then those in between for which it does not decide."""
BEAM = 12
"""Balls of each level that are followed straight down the tree."""
MOST_RANKS = 1 << 30
ENOUGH = 1.5
"""Multiple of the needed distance from which a distance need not be known well."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """The distance between a nozzle and obstacles.

    ``standoff``: how far the tip is above the point that it works on. ``detail``: how far the obstacles may lie from
    what they stand for; it is taken off each distance. ``floor``: a height below which obstacles do not count;
    ``until``: the last rank of those that stand already. ``beam``: what has to be free between the tip and the bead
    while the tool deposits; None: it is not checked. ``endless``: the bounds take the nozzle's body to go on above its
    end, so that a pose that is free has a straight way out.
    """

    nozzle: Nozzle
    standoff: float
    obstacles: Obstacles | None = None
    detail: float = 0.0
    floor: float = -np.inf
    until: int = 0
    beam: Beam | None = None
    endless: bool = True

    def with_obstacles(self, obstacles: Obstacles | None) -> Clearance:
        """The same nozzle among other obstacles."""
        return replace(self, obstacles=obstacles)

    def above(self, floor: float) -> Clearance:
        """The same, where the bounds leave out what lies below the height ``floor``: the caller knows it to be far."""
        return replace(self, floor=floor)

    def after(self, rank: int) -> Clearance:
        """The same, among the obstacles of all ranks up to ``rank``."""
        return replace(self, until=rank)

    def without_beam(self) -> Clearance:
        """The same while nothing is deposited."""
        return replace(self, beam=None)

    def during_travel(self) -> Clearance:
        """The same between passes, where the nozzle is as long as it is."""
        return replace(self, beam=None, endless=False)

    @cached_property
    def beams(self) -> list[Clearance]:
        """The bodies of the beam among the same obstacles."""
        if self.beam is None:
            return []
        bodies = self.beam.draw(self.standoff)
        return [replace(self, nozzle=body, standoff=self.beam.lift, beam=None) for body in bodies]

    def find_shaded(self, points: Floats, axes: Floats) -> Flags:
        """Whether something stands in the beam (N,) at poses along a path, ``points`` and ``axes`` (N,3)."""
        shaded = np.zeros(len(points), bool)
        for each in self.beams:
            assert self.beam is not None
            shaded |= each.measure_poses(points, axes, self.beam.needed) < self.beam.needed
        return shaded

    @property
    def reach(self) -> float:
        """The farthest point of the nozzle from the point that it works on."""
        far = self.nozzle.mesh.vertices + np.array([0, 0, self.standoff])
        return float(np.linalg.norm(far, axis=1).max())

    def measure(self, point: Floats, axis: Floats, ranks: Ints | None = None) -> float:
        """Distance between the nozzle, working on ``point`` (3,) with its axis along ``axis`` (3,), and the obstacles.

        0 where they touch or overlap; inf without obstacles. ``ranks``: only those of these ranks.
        """
        import fcl

        found = np.inf
        if self.obstacles is None:
            return found
        moving = self.nozzle.object
        moving.setTransform(fcl.Transform(turn_to_axis(axis), point + self.standoff * axis))
        for rank, each in zip(self.obstacles.ranks, self.obstacles.objects, strict=True):
            if rank <= self.until and (ranks is None or rank in ranks):
                found = min(found, fcl.distance(each, moving, fcl.DistanceRequest(), fcl.DistanceResult()))
        return max(float(found) - self.detail, 0.0)

    def bound(
        self, points: Floats, axes: Floats, needed: float, near: list[Ints] | None = None
    ) -> tuple[Floats, Floats]:
        """Two distances (N,) for the poses at ``points`` (N,3) with ``axes`` (N,3): the true one lies between them.

        They are only as near to each other as it takes to see whether the nozzle keeps the distance ``needed``.
        ``near`` takes the poses and the ranks (K,2) of what may be nearer than ``ENOUGH`` times that. Both are 0 where
        something stands in the beam, and the lower one where that may be.
        """
        low, high = self._bound_body(points, axes, needed, near)
        for each in self.beams:
            assert self.beam is not None
            least, most = each.bound(points, axes, self.beam.needed)
            low[least < self.beam.needed] = 0.0
            high[most < self.beam.needed] = 0.0
        return low, high

    def _bound_body(
        self, points: Floats, axes: Floats, needed: float, near: list[Ints] | None = None
    ) -> tuple[Floats, Floats]:
        """As `bound`, without the beam."""
        low, high = np.full(len(points), np.inf), np.full(len(points), np.inf)
        if self.obstacles is None or not self.obstacles.levels:
            return low, high
        if self.nozzle.profile is None:
            return np.zeros(len(points)), high
        tips = points + self.standoff * axes
        for start in range(0, len(points), CHUNK):
            own = slice(start, start + CHUNK)
            low[own], high[own], pairs = self._bound_some(tips[own], axes[own], needed + self.detail)
            if near is not None:
                near.append(pairs + np.array([start, 0], np.int64))
        return np.maximum(low - self.detail, 0.0), np.maximum(high - self.detail, 0.0)

    def _bound_some(self, tips: Floats, axes: Floats, needed: float) -> tuple[Floats, Floats, Ints]:
        """As `bound`, from tips (N,3), with the poses and ranks (K,2). Most poses
        that are not free are found straight down the tree; the others go down it wherever a ball is near."""
        assert self.obstacles is not None
        levels = self.obstacles.levels
        low, high = np.full(len(tips), np.inf), np.full(len(tips), np.inf)
        ball = np.flatnonzero((levels[0].top > self.floor) & (levels[0].rank <= self.until))
        pairs = np.empty((0, 2), np.int64)
        if not len(ball):
            return low, high, pairs
        self._dive(ball, tips, axes, needed, high)
        pose = np.repeat(np.flatnonzero(high >= needed), len(ball))
        ball = np.tile(ball, len(tips))[: len(pose)]
        for number, level in enumerate(levels):
            going = high.take(pose) >= needed
            pose, ball = pose[going], ball[going]
            if not len(ball):
                break
            own = self._measure_from(level.middle.take(ball, 0), pose, tips, axes)
            radius = level.radius.take(ball)
            if number == len(levels) - 1:
                _take_least(high, pose, np.maximum(own, 0.0))
                _take_least(low, pose, own - radius)
                close = own - radius < ENOUGH * needed
                pairs = np.stack([pose[close], level.rank.take(ball[close])], axis=1)
                break
            _take_least(high, pose, np.maximum(own + radius, 0.0))
            lower = own - radius
            near = lower < ENOUGH * needed
            _take_least(low, pose[~near], lower[~near])
            pose, ball = np.repeat(pose[near], MEMBERS), _list_members(ball[near]).ravel()
            following = levels[number + 1]
            kept = np.flatnonzero((following.top.take(ball) > self.floor) & (following.rank.take(ball) <= self.until))
            pose, ball = pose[kept], ball[kept]
        low[high < needed] = 0.0
        return low, high, pairs

    def _measure_from(self, points: Floats, pose: Ints, tips: Floats, axes: Floats) -> Floats:
        """Distances (M,) of points (M,3) from the nozzle at a ``pose`` (M,) each; negative inside."""
        assert self.nozzle.profile is not None
        return measure_points(points, tips.take(pose, 0), axes.take(pose, 0), self.nozzle.profile, self.endless)

    def _dive(self, roots: Ints, tips: Floats, axes: Floats, needed: float, high: Floats) -> None:
        """Lowers ``high`` (N,) straight down the tree: from the nearest of the balls ``roots`` (K,) to the nearest that
        they hold, and so on, by a point on the surface in each."""
        assert self.obstacles is not None
        pose = np.arange(len(tips))
        ball = np.tile(roots, (len(tips), 1))
        for number, level in enumerate(self.obstacles.levels):
            flat, count = ball.ravel(), ball.shape[1]
            own = self._measure_from(level.one.take(flat, 0), np.repeat(pose, count), tips, axes)
            own[(level.top.take(flat) <= self.floor) | (level.rank.take(flat) > self.until)] = np.inf
            found = own.reshape(-1, count)
            most = min(BEAM, count - 1)
            nearest = np.argpartition(found, most, axis=1)[:, : most + 1]
            value = found.min(axis=1)
            high[pose] = np.minimum(high[pose], np.maximum(value, 0.0))
            going = value >= needed
            pose, ball = pose[going], np.take_along_axis(ball, nearest, axis=1)[going]
            if not len(pose) or number == len(self.obstacles.levels) - 1:
                break
            ball = _list_members(ball.ravel()).reshape(len(pose), -1)

    def measure_poses(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """For each pose (N,) a distance that the nozzle keeps at least; below ``needed`` only where it really is.

        ``points``, ``axes`` (N,3): as in `bound`. 0 where something stands in the beam.
        """
        found = self._measure_body(points, axes, needed)
        open_ = np.flatnonzero(found >= needed)
        if self.beam is not None and len(open_):
            found[open_[self.find_shaded(points[open_], axes[open_])]] = 0.0
        return found

    def _measure_body(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """As `measure_poses`, without the beam."""
        moves = np.linalg.norm(np.diff(points, axis=0), axis=1) + self.bound_turns(axes)
        far = np.concatenate([[0.0], np.cumsum(moves)])
        found = np.full(len(points), -np.inf)
        for stride in STRIDES:
            own = np.arange(0, len(points), stride)
            own = own[found[own] == -np.inf]
            if len(own):
                found[own] = self._measure_some(points[own], axes[own], far[own], needed)
            known = np.flatnonzero(found >= needed)
            if len(known):
                found = _carry_over(found, far, known, needed)
        return found

    def _measure_some(self, points: Floats, axes: Floats, far: Floats, needed: float) -> Floats:
        """As `measure_poses`; ``far`` (N,): the way to each pose."""
        near: list[Ints] = []
        low, high = self._bound_body(points, axes, needed, near)
        found = np.where(high < needed, high, low)
        undecided = np.flatnonzero((low < needed) & (high >= needed))
        if not len(undecided):
            return found
        ranks = self._list_ranks(near, undecided, len(points))
        known, at = -np.inf, 0.0
        for k, own in zip(undecided, ranks, strict=True):
            if known - (far[k] - at) < needed:
                known, at = self.measure(points[k], axes[k], own), float(far[k])
                if own is not None:  # the others are farther than that
                    known = min(known, ENOUGH * needed)
            found[k] = known - (far[k] - at)
        return found

    def _list_ranks(self, near: list[Ints], chosen: Ints, count: int) -> list[Ints | None]:
        """For each of the ``chosen`` of ``count`` poses the ranks of what may be near; None for all."""
        assert self.obstacles is not None
        if not near or self.obstacles.ranks[-1] == self.obstacles.ranks[0]:
            return [None] * len(chosen)
        number = list_distinct(np.concatenate(near) @ np.array([MOST_RANKS, 1]))
        pose, rank = number // MOST_RANKS, number % MOST_RANKS
        ends = np.searchsorted(pose, np.arange(count + 1))
        return [rank[ends[k] : ends[k + 1]] for k in chosen]

    def bound_turns(self, axes: Floats) -> Floats:
        """How far (N-1,) any point of the nozzle moves at most while its axis turns from each of ``axes`` (N,3) to the
        next about the point it works on."""
        chord = np.linalg.norm(np.diff(axes, axis=0), axis=1)
        return np.asarray(2 * np.arcsin(np.clip(chord / 2, 0, 1)) * self.reach)


def _list_members(ball: Ints) -> Ints:
    """The balls (K,MEMBERS) of the next level that balls (K,) hold."""
    return np.asarray(MEMBERS * ball[:, None] + np.arange(MEMBERS))


def _take_least(least: Floats, pose: Ints, found: Floats) -> None:
    """Lowers each of ``least`` (N,) to the values ``found`` (M,) of its ``pose`` (M,), which is sorted."""
    if len(pose):
        starts = np.flatnonzero(np.concatenate([[True], pose[1:] != pose[:-1]]))
        own = pose[starts]
        least[own] = np.minimum(least[own], np.minimum.reduceat(found, starts))


def measure_points(points: Floats, tips: Floats, axes: Floats, profile: Floats, endless: bool) -> Floats:
    """Distances (N,) of points (N,3) to the nozzle with its tip at ``tips`` (N,3) and its axis along ``axes`` (N,3);
    negative inside. ``endless``: its body goes on above its end."""
    away = points - tips
    height = np.einsum("ij,ij->i", away, axes)
    radius = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - height**2, 0.0))
    return _measure_to_profile(height, radius, profile, endless)


def _carry_over(found: Floats, far: Floats, known: Ints, needed: float) -> Floats:
    """Distances (N,) of poses that follow from those at the ``known`` ones and the way ``far`` (N,) between them."""
    number = np.searchsorted(known, np.arange(len(found)), side="right")
    before, after = known[np.maximum(number - 1, 0)], known[np.minimum(number, len(known) - 1)]
    implied = np.maximum(found[before] - np.abs(far - far[before]), found[after] - np.abs(far - far[after]))
    return np.where((found == -np.inf) & (implied >= needed), implied, found)


def _measure_to_profile(height: Floats, radius: Floats, profile: Floats, endless: bool) -> Floats:
    """Distances of points to the surface of a solid of revolution whose ``profile`` (K,2) has height and radius;
    negative inside.

    The profile is that of `Cone`: from the tip upward, never narrower.
    """
    tip, last = profile[0, 1], profile[-1, 1]
    rise, end = profile[1, 0], np.inf if endless else profile[-1, 0]
    side = np.array([rise - profile[0, 0], profile[1, 1] - tip])
    out = radius - tip
    along = np.clip((height * side[0] + out * side[1]) / (side @ side), 0, 1)
    found = (height - along * side[0]) ** 2 + (out - along * side[1]) ** 2
    np.minimum(found, height**2 + np.maximum(out, 0) ** 2, out=found)
    beside = np.maximum(rise - height, 0) + np.maximum(height - end, 0)
    np.minimum(found, beside**2 + (radius - last) ** 2, out=found)
    if not endless:
        np.minimum(found, (height - end) ** 2 + np.maximum(radius - last, 0) ** 2, out=found)
    np.sqrt(found, out=found)
    inside: Flags = (height > 0) & (height < end) & (radius < last) & (out * side[0] < height * side[1])
    return np.asarray(np.where(inside, -found, found))
