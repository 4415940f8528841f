"""How far the nozzle stays from what it must not touch.

Two measures. Bounds come from points that are spread over the obstacles: each stands for the surface within a known
distance of it, and its distance to a nozzle that is a solid of revolution follows from a formula, for many poses at
once. Where the bounds do not decide, the FCL library gives the exact distance between the triangles of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.duplicates import order_integers
from damageest.geometry.voxels import number_cubes
from damageest.paths.nozzle import Nozzle, turn_to_axis

CHUNK = 400_000
"""Distances that are computed at once, so that intermediate arrays fit in the processor's cache."""
STRIDES = (16, 4, 1)
"""Of the poses of a pass, each sixteenth is measured first, then those in between for which it does not decide."""
CELL = 2.0
"""Edge of the cubes whose points are one group, in bead widths."""
ENOUGH = 1.5
"""Multiple of the needed distance from which a distance need not be known well."""
FINE, GROWTH = 0.4, 0.4
"""Longest edge of the obstacles' triangles, whose middles are the points: in bead widths near the deposit, and as a
share of the distance from it."""


class Obstacles:
    """Meshes prepared for distances to the nozzle, in coordinates near the origin.

    ``points`` (K,3) on them; each stands for the surface within ``reach`` (K,) of it.
    """

    def __init__(self, meshes: Sequence[Mesh], low: Floats, high: Floats, width: float) -> None:
        """``low``, ``high`` (3,): the box round the deposit, near which the points are dense; ``width`` of a bead."""
        import fcl

        self.objects = [fcl.CollisionObject(make_tree(mesh), fcl.Transform()) for mesh in meshes]
        parts = [_cut_triangles(mesh.triangles, low, high, width) for mesh in meshes]
        triangles = np.concatenate(parts) if parts else np.empty((0, 3, 3))
        points = triangles.mean(axis=1)
        order, self.start = _group_points(points, CELL * width)
        self.points: Floats = points[order]
        self.reach: Floats = np.linalg.norm(triangles[order] - self.points[:, None], axis=2).max(axis=1, initial=0.0)
        self.count: Ints = np.diff(np.append(self.start, len(points)))
        middles, radii, tops = [np.empty((0, 3))], list[float](), list[float]()
        for first, many in zip(self.start, self.count, strict=True):
            own = self.points[first : first + many]
            middle = (own.min(axis=0) + own.max(axis=0)) / 2
            middles.append(middle[None])
            away = np.linalg.norm(own - middle, axis=1)
            radii.append(float((away + self.reach[first : first + many]).max()))
            tops.append(float((own[:, 2] + self.reach[first : first + many]).max()))
        self.middle: Floats = np.concatenate(middles)
        whose = np.repeat(np.arange(len(self.start)), self.count)
        off = np.linalg.norm(self.points - self.middle[whose], axis=1)
        self.sample: Ints = np.lexsort([off, whose])[self.start]
        self.radius: Floats = np.array(radii)
        self.top: Floats = np.array(tops)


def _group_points(points: Floats, edge: float) -> tuple[Ints, Ints]:
    """An order (K,) of points (K,3) in which those of one cube follow each other, and where each cube (C,) begins."""
    if not len(points):
        return np.empty(0, np.int64), np.empty(0, np.int64)
    cube = number_cubes(points, edge)[1]
    order = order_integers(cube)
    return order, np.flatnonzero(np.concatenate([[True], np.diff(cube[order]) != 0]))


def make_tree(mesh: Mesh) -> Any:
    """FCL's tree of boxes over the triangles of a mesh."""
    import fcl

    tree = fcl.BVHModel()
    tree.beginModel(len(mesh.vertices), len(mesh.faces))
    tree.addSubModel(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces))
    tree.endModel()
    return tree


def _cut_triangles(triangles: Floats, low: Floats, high: Floats, width: float) -> Floats:
    """Triangles (F,3,3), halved at their longest edges until they are small enough for their distance from a box."""
    done = []
    while len(triangles):
        away = triangles.mean(axis=1)
        away = np.linalg.norm(np.maximum(np.maximum(low - away, away - high), 0), axis=1)
        sides = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        longest = sides.argmax(axis=1)
        large = sides.max(axis=1) > np.maximum(FINE * width, GROWTH * away)
        done.append(triangles[~large])
        cut = triangles[large]
        order = (longest[large, None] + np.arange(3)) % 3
        a, b, c = np.moveaxis(np.take_along_axis(cut, order[..., None], axis=1), 1, 0)
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done) if done else triangles


@dataclass(frozen=True, eq=False)
class Clearance:
    """The distance between a nozzle and obstacles.

    ``standoff``: how far the tip is above the point that it works on. ``detail``: how far the obstacles may lie from
    what they stand for; it is taken off each distance. ``floor``: a height below which obstacles do not count.
    """

    nozzle: Nozzle
    standoff: float
    obstacles: Obstacles | None = None
    detail: float = 0.0
    floor: float = -np.inf

    def with_obstacles(self, obstacles: Obstacles | None) -> Clearance:
        """The same nozzle among other obstacles."""
        return replace(self, obstacles=obstacles)

    def above(self, floor: float) -> Clearance:
        """The same, where the bounds leave out what lies below the height ``floor``: the caller knows it to be far."""
        return replace(self, floor=floor)

    @property
    def reach(self) -> float:
        """The farthest point of the nozzle from the point that it works on."""
        far = self.nozzle.mesh.vertices + np.array([0, 0, self.standoff])
        return float(np.linalg.norm(far, axis=1).max())

    def measure(self, point: Floats, axis: Floats) -> float:
        """Distance between the nozzle, working on ``point`` (3,) with its axis along ``axis`` (3,), and the obstacles.

        0 where they touch or overlap; inf without obstacles.
        """
        import fcl

        found = np.inf
        if self.obstacles is None:
            return found
        moving = self.nozzle.object
        moving.setTransform(fcl.Transform(turn_to_axis(axis), point + self.standoff * axis))
        for each in self.obstacles.objects:
            found = min(found, fcl.distance(each, moving, fcl.DistanceRequest(), fcl.DistanceResult()))
        return max(float(found) - self.detail, 0.0)

    def bound(self, points: Floats, axes: Floats, needed: float) -> tuple[Floats, Floats]:
        """Two distances (N,) for the poses at ``points`` (N,3) with ``axes`` (N,3): the true one lies between them.

        They are only as near to each other as it takes to see whether the nozzle keeps the distance ``needed``.
        """
        low, high = np.full(len(points), np.inf), np.full(len(points), np.inf)
        near = self.obstacles
        if near is None or not len(near.points):
            return low, high
        if self.nozzle.profile is None:
            return np.zeros(len(points)), high
        groups = np.flatnonzero(near.top > self.floor)
        if not len(groups):
            return low, high
        tips = points + self.standoff * axes
        groups = self._choose_groups(tips, axes, groups, needed + self.detail)
        if not len(groups):
            return np.full(len(points), needed), high
        step = max(CHUNK // len(groups), 1)
        for start in range(0, len(points), step):
            own = slice(start, start + step)
            low[own], high[own] = self._bound_some(tips[own], axes[own], groups, needed + self.detail)
        return np.maximum(low - self.detail, 0.0), np.maximum(high - self.detail, 0.0)

    def _choose_groups(self, tips: Floats, axes: Floats, groups: Ints, needed: float) -> Ints:
        """Those of the groups of points that can matter for poses (N,) of one axis; all where there are several."""
        near, profile = self.obstacles, self.nozzle.profile
        assert near is not None
        assert profile is not None
        if len(tips) < 4 or np.abs(axes - axes[0]).max() > 1e-12:
            return groups
        middle = (tips.min(axis=0) + tips.max(axis=0)) / 2
        extent = float(np.linalg.norm(tips - middle, axis=1).max())
        count = len(groups)
        away = _measure_points(near.middle[groups], np.tile(middle, (count, 1)), np.tile(axes[0], (count, 1)), profile)
        return groups[away - near.radius[groups] - extent < ENOUGH * needed]

    def _bound_some(self, tips: Floats, axes: Floats, groups: Ints, needed: float) -> tuple[Floats, Floats]:
        """As `bound`, from tips (N,3): first for groups of points and one of each, then for the points of near ones."""
        near, profile = self.obstacles, self.nozzle.profile
        assert near is not None
        assert profile is not None
        middle = near.middle[groups]
        height = axes @ middle.T - np.einsum("ij,ij->i", axes, tips)[:, None]
        squares = np.einsum("ij,ij->i", middle, middle)
        away = squares + np.einsum("ij,ij->i", tips, tips)[:, None] - 2 * (tips @ middle.T)
        radius = np.sqrt(np.maximum(away - height**2, 0.0))
        lower = _measure_to_profile(height, radius, profile) - near.radius[groups]
        close = lower < ENOUGH * needed
        low = np.where(close, np.inf, lower).min(axis=1)
        high = np.full(len(tips), np.inf)
        pose, group = np.nonzero(close)
        if not len(pose):
            return low, high
        one = near.sample[groups[group]]
        found = _measure_points(near.points[one], tips[pose], axes[pose], profile)
        found[near.points[one, 2] <= self.floor] = np.inf
        np.minimum.at(high, pose, found)
        hit = high < needed
        low[hit] = 0.0
        going = ~hit[pose]
        pose, group = pose[going], group[going]
        if not len(pose):
            return low, high
        count = near.count[groups[group]]
        ends = np.cumsum(count)
        for first, last in _split(ends, 4 * CHUNK):
            own = slice(first, last)
            many = count[own]
            shift = near.start[groups[group[own]]] - (np.cumsum(many) - many)
            number = np.repeat(shift, many) + np.arange(int(many.sum()))
            whose = np.repeat(pose[own], many)
            found = _measure_points(near.points[number], tips[whose], axes[whose], profile)
            found[near.points[number, 2] + near.reach[number] <= self.floor] = np.inf
            starts = np.flatnonzero(np.concatenate([[True], np.diff(whose) != 0]))
            held = whose[starts]
            high[held] = np.minimum(high[held], np.minimum.reduceat(found, starts))
            low[held] = np.minimum(low[held], np.minimum.reduceat(found - near.reach[number], starts))
        return low, high

    def measure_poses(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """For each pose (N,) a distance that the nozzle keeps at least; below ``needed`` only where it really is.

        ``points``, ``axes`` (N,3): as in `bound`.
        """
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
        low, high = self.bound(points, axes, needed)
        found = np.where(high < needed, high, low)
        known, at = -np.inf, 0.0
        for k in np.flatnonzero((low < needed) & (high >= needed)):
            if known - (far[k] - at) < needed:
                known, at = self.measure(points[k], axes[k]), float(far[k])
            found[k] = known - (far[k] - at)
        return found

    def bound_turns(self, axes: Floats) -> Floats:
        """How far (N-1,) any point of the nozzle moves at most while its axis turns from each of ``axes`` (N,3) to the
        next about the point it works on."""
        chord = np.linalg.norm(np.diff(axes, axis=0), axis=1)
        return np.asarray(2 * np.arcsin(np.clip(chord / 2, 0, 1)) * self.reach)


def _split(ends: Ints, most: int) -> list[tuple[int, int]]:
    """Ranges of items, ``ends`` (N,) being the sums of their sizes, of about ``most`` in size each."""
    cuts = np.unique(np.concatenate([[0], np.searchsorted(ends, np.arange(most, ends[-1], most)), [len(ends)]]))
    return list(zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True))


def _measure_points(points: Floats, tips: Floats, axes: Floats, profile: Floats) -> Floats:
    """Distances (N,) of points (N,3) to the nozzle with its tip at ``tips`` (N,3) and its axis along ``axes`` (N,3)."""
    away = points - tips
    height = np.einsum("ij,ij->i", away, axes)
    radius = np.sqrt(np.maximum(np.einsum("ij,ij->i", away, away) - height**2, 0.0))
    return _measure_to_profile(height, radius, profile)


def _carry_over(found: Floats, far: Floats, known: Ints, needed: float) -> Floats:
    """Distances (N,) of poses that follow from those at the ``known`` ones and the way ``far`` (N,) between them."""
    number = np.searchsorted(known, np.arange(len(found)), side="right")
    before, after = known[np.maximum(number - 1, 0)], known[np.minimum(number, len(known) - 1)]
    implied = np.maximum(found[before] - np.abs(far - far[before]), found[after] - np.abs(far - far[after]))
    return np.where((found == -np.inf) & (implied >= needed), implied, found)


def _measure_to_profile(height: Floats, radius: Floats, profile: Floats) -> Floats:
    """Distances of points to a solid of revolution whose ``profile`` (K,2) has height and radius; 0 inside.

    The profile is that of `Cone`: from the tip upward, never narrower. The body goes on above its last height.
    """
    tip, last = profile[0, 1], profile[-1, 1]
    rise = profile[1, 0]
    side = np.array([rise - profile[0, 0], profile[1, 1] - tip])
    length = float(np.linalg.norm(side))
    along = np.clip((height * side[0] + (radius - tip) * side[1]) / length**2, 0, 1)
    found = np.hypot(height - along * side[0], radius - tip - along * side[1])
    np.minimum(found, np.hypot(height, np.maximum(radius - tip, 0)), out=found)
    np.minimum(found, np.hypot(np.maximum(rise - height, 0), radius - last), out=found)
    inside: Flags = (height > 0) & (radius < last) & ((radius - tip) * side[0] < height * side[1])
    found[inside] = 0.0
    return np.asarray(found)
