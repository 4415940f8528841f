"""Bounds on the distance of a nozzle that is a solid of revolution, for many poses at once.

A point's distance to such a nozzle follows from a formula. The points are spread over the obstacles: each stands for
the surface within a known distance of it. Where that does not decide, the surface is cut into smaller pieces there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest_paths.obstacles import MEMBERS, Level, Obstacles

BEAM = 12
"""Balls of each level that are followed straight down the tree."""
ENOUGH = 1.5
"""Multiple of the needed distance from which a distance need not be known well."""
EACH, WORTH = 8, 0.5
"""One of so many poses is followed straight down the tree first; the others are if such a share of these hits."""
CUTS = 9
"""How often a triangle is cut in four at most. An edge is 500 times shorter then."""
MOST_PIECES = 200_000
"""Pieces of triangles that are looked at together: where more are open, the exact distance costs less."""


@dataclass(frozen=True, eq=False)
class Descent:
    """A nozzle with this ``profile`` (K,2) among obstacles. ``floor``: a height below which they do not count;
    ``until``: the last rank of those that stand; ``endless``: the nozzle's body goes on above its end."""

    obstacles: Obstacles
    profile: Floats
    endless: bool
    floor: float
    until: int

    def bound(self, tips: Floats, axes: Floats, needed: float, is_tight: bool = True) -> tuple[Floats, Floats, Ints]:
        """Two distances (N,) for poses with ``tips`` and ``axes`` (N,3): the true one lies between them. They are only
        as near to each other as it takes to see whether ``needed`` is kept; the lower one is 0 where it is not. And the
        poses and ranks (K,2) of what may be nearer than `ENOUGH` times that.

        Most poses that are not free are found straight down the tree; the others go down it wherever a ball is near.
        ``is_tight``: whether the upper distance counts where it is below ``needed``; else it may be larger there.
        """
        levels, count = self.obstacles.levels, len(tips)
        low, high = np.full(count, np.inf), np.full(count, np.inf)
        tips, axes = np.ascontiguousarray(tips.T), np.ascontiguousarray(axes.T)
        ball = np.flatnonzero(self._counts(levels[0]))
        pairs = np.empty((0, 2), np.int64)
        if not len(ball):
            return low, high, pairs
        if is_tight:
            self._dive(ball, tips, axes, needed, high)
        else:
            self._find_hits(ball, tips, axes, needed, high)
        pose = np.repeat(np.flatnonzero(high >= needed), len(ball))
        ball = np.tile(ball, count)[: len(pose)]
        for number, level in enumerate(levels):
            going = high.take(pose) >= needed
            pose, ball = pose[going], ball[going]
            if not len(ball):
                break
            middle = level.middle.take(ball, 1)
            own = self._measure_from(middle, pose, tips, axes)
            radius = level.radius.take(ball)
            lower = own - radius
            if number == len(levels) - 1:
                _take_least(high, pose, self._measure_high(own, middle[2]))
                close = lower < ENOUGH * needed
                pairs = np.stack([pose[close], level.rank.take(ball[close])], axis=1)
                open_ = (lower < needed) & (high.take(pose) >= needed)
                _take_least(low, pose[~open_], lower[~open_])
                self._cut(pose[open_], ball[open_], own[open_], tips, axes, needed, low, high)
                break
            _take_least(high, pose, np.maximum(own + radius, 0.0))
            near = lower < ENOUGH * needed
            _take_least(low, pose[~near], lower[~near])
            pose, ball = np.repeat(pose[near], MEMBERS), list_members(ball[near]).ravel()
            kept = np.flatnonzero(self._counts(levels[number + 1], ball))
            pose, ball = pose[kept], ball[kept]
        low[high < needed] = 0.0
        return low, high, pairs

    def _find_hits(self, roots: Ints, tips: Floats, axes: Floats, needed: float, high: Floats) -> None:
        """Lowers ``high`` (N,) by `_dive`, for all poses only where that decides many: one that is free has to go down
        the whole tree after it."""
        number = np.arange(len(high))
        for own in (number[::EACH], number[number % EACH > 0]):
            found = high[own]
            self._dive(roots, tips[:, own], axes[:, own], needed, found)
            high[own] = found
            if (found < needed).sum() < WORTH * len(own):
                break

    def _counts(self, level: Level, ball: Ints | None = None) -> Flags:
        """Whether the balls (K,) of a level, by default all, hold something that counts."""
        top, rank = (level.top, level.rank) if ball is None else (level.top.take(ball), level.rank.take(ball))
        return np.asarray((top > self.floor) & (rank <= self.until))

    def _cut(
        self, pose: Ints, ball: Ints, own: Floats, tips: Floats, axes: Floats, needed: float, low: Floats, high: Floats
    ) -> None:
        """Lowers ``low`` and ``high`` (N,) by what the triangles of balls (K,), whose middles are ``own`` (K,) away,
        are away from the poses (K,), which are sorted. A triangle that may be too near is cut in four until each piece
        decides."""
        radius = self.obstacles.levels[-1].radius.take(ball)
        corners = self.obstacles.find_triangles(ball)
        for _ in range(CUTS):
            if not 0 < len(pose) <= MOST_PIECES:
                break
            # the piece in the middle has the middle of the whole; the others lie at its corners
            outer = np.ascontiguousarray(((corners + _sum_corners(corners) / 3) / 2).reshape(-1, 3).T)
            pieces, radius = np.empty((len(pose), 4)), radius / 2
            pieces[:, :3] = self._measure_from(outer, np.repeat(pose, 3), tips, axes).reshape(-1, 3)
            pieces[:, 3] = own
            _take_least(high, np.repeat(pose, 3), self._measure_high(pieces[:, :3].ravel(), outer[2]))
            lower = pieces - radius[:, None]
            is_open = (lower < needed) & (high.take(pose) >= needed)[:, None]
            _take_least(low, np.repeat(pose, 4), np.where(is_open, np.inf, lower).ravel())
            which, kind = np.nonzero(is_open)
            corners = _cut_corners(corners[which], kind)
            kept = corners[:, :, 2].max(axis=1) > self.floor
            pose, radius, own, corners = (
                pose[which[kept]],
                radius[which[kept]],
                pieces[which, kind][kept],
                corners[kept],
            )
        _take_least(low, pose, own - radius)

    def _measure_high(self, own: Floats, height: Floats) -> Floats:
        """The distances (K,) of points on obstacles, whose signed ones are ``own``; infinite where a point does not
        count because of its ``height`` (K,), as what it stands for may lie higher than it does."""
        return np.where(height > self.floor, np.maximum(own, 0.0), np.inf)

    def _measure_from(self, points: Floats, pose: Ints, tips: Floats, axes: Floats) -> Floats:
        """Distances (M,) of points (3,M) from the nozzle at a ``pose`` (M,) each; negative inside."""
        return measure_points(points, tips.take(pose, 1), axes.take(pose, 1), self.profile, self.endless)

    def _dive(self, roots: Ints, tips: Floats, axes: Floats, needed: float, high: Floats) -> None:
        """Lowers ``high`` (N,) straight down the tree: from the nearest of the balls ``roots`` (K,) to the nearest that
        they hold, and so on, by a point on the surface in each."""
        pose = np.arange(len(high))
        ball = np.tile(roots, (len(high), 1))
        for number, level in enumerate(self.obstacles.levels):
            flat, count = ball.ravel(), ball.shape[1]
            one = level.one.take(flat, 1)
            own = self._measure_from(one, np.repeat(pose, count), tips, axes)
            own[~self._counts(level, flat)] = np.inf
            found = own.reshape(-1, count)
            most = min(BEAM, count - 1)
            nearest = np.argpartition(found, most, axis=1)[:, : most + 1]
            value = self._measure_high(own, one[2]).reshape(-1, count).min(axis=1)
            high[pose] = np.minimum(high[pose], value)
            going = value >= needed
            pose, ball = pose[going], np.take_along_axis(ball, nearest, axis=1)[going]
            if not len(pose) or number == len(self.obstacles.levels) - 1:
                break
            ball = list_members(ball.ravel()).reshape(len(pose), -1)


def _cut_corners(corners: Floats, kind: Ints) -> Floats:
    """Of triangles (K,3,3) that are cut in four at the middles of their edges the piece at corner 0, 1 or 2, or for the
    ``kind`` (K,) 3 the piece in the middle."""
    opposite = (_sum_corners(corners) - corners) / 2
    outer = np.flatnonzero(kind < 3)
    opposite[outer, kind[outer]] = corners[outer, kind[outer]]
    return opposite


def _sum_corners(corners: Floats) -> Floats:
    """The sums (K,1,3) of the corners of triangles (K,3,3); numpy's own take five times as long over three."""
    return corners[:, :1] + corners[:, 1:2] + corners[:, 2:]


def list_members(ball: Ints) -> Ints:
    """The balls (K,MEMBERS) of the next level that balls (K,) hold."""
    return np.asarray(MEMBERS * ball[:, None] + np.arange(MEMBERS))


def _take_least(least: Floats, pose: Ints, found: Floats) -> None:
    """Lowers each of ``least`` (N,) to the values ``found`` (M,) of its ``pose`` (M,), which is sorted."""
    if len(pose):
        starts = np.flatnonzero(np.concatenate([[True], pose[1:] != pose[:-1]]))
        own = pose[starts]
        least[own] = np.minimum(least[own], np.minimum.reduceat(found, starts))


def measure_points(points: Floats, tips: Floats, axes: Floats, profile: Floats, endless: bool) -> Floats:
    """Distances (N,) of points (3,N) to the nozzle with its tip at ``tips`` (3,N) and its axis along ``axes`` (3,N);
    negative inside. ``endless``: its body goes on above its end. All three hold places or directions as columns."""
    away = points - tips
    along = away * axes
    height = along[0]
    height += along[1]
    height += along[2]
    away *= away
    radius = away[0]
    radius += away[1]
    radius += away[2]
    radius -= height**2
    np.maximum(radius, 0.0, out=radius)
    np.sqrt(radius, out=radius)
    return _measure_to_profile(height, radius, profile, endless)


def _measure_to_profile(height: Floats, radius: Floats, profile: Floats, endless: bool) -> Floats:
    """Distances of points to the surface of a solid of revolution whose ``profile`` (K,2) has height and radius;
    negative inside.

    The profile is that of `Cone`: from the tip upward, never narrower. So it is convex: the distance is the largest of
    those to the lines of its sides, but where a corner is nearest.
    """
    tip, last = profile[0, 1], profile[-1, 1]
    rise, end = profile[1, 0], np.inf if endless else profile[-1, 0]
    length = float(np.hypot(rise - profile[0, 0], profile[1, 1] - tip))
    up, out = float((rise - profile[0, 0]) / length), float((profile[1, 1] - tip) / length)
    beside, beyond = radius - tip, radius - last
    along = height * up + beside * out
    found = np.maximum(beside * up - height * out, beyond)
    np.maximum(found, -height, out=found)
    corners = [
        ((along < 0) & (beside > 0), height, beside),
        ((along > length) & (height < rise), height - rise, beyond),
    ]
    if not endless:
        above = height - end
        np.maximum(found, above, out=found)
        corners.append(((above > 0) & (beyond > 0), above, beyond))
    for nearest, over, aside in corners:
        which = np.flatnonzero(nearest)
        found[which] = np.hypot(over[which], aside[which])
    return np.asarray(found)
