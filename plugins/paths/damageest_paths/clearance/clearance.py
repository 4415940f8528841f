"""How far the nozzle stays from what it must not touch.

Two measures. Bounds are found for many poses at once, for a nozzle that is a solid of revolution. Where they do not
decide, the FCL library gives the exact distance between the triangles of both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.transforms import turn_to_axis
from damageest_paths.clearance.descent import ENOUGH, Descent
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.tool.nozzle import Nozzle
from damageest_paths.tool.sight import Beam

STRIDES = (16, 4, 1)
"""Of the poses of a pass, each sixteenth is measured first, then those in between for which it does not decide."""
CLOSE = 0.1
"""Share of the needed distance by which a pose may keep more and yet count as one that does not keep it, where the
bounds do not decide: then an exact distance is not worth its time."""


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
        """Whether something stands in the beam (N,) at poses along a path, ``points`` and ``axes`` (N,3).

        Poses between which the beam moves by little are as both beside them are; they are looked at where these differ.
        """
        shaded = np.zeros(len(points), bool)
        for each in self.beams:
            assert self.beam is not None
            needed, numbers = self.beam.needed, np.arange(len(points))
            chosen = _choose_poses(_add_up(each.bound_moves(points, axes)), self.beam.spacing)
            found = each.measure_poses(points[chosen], axes[chosen], needed) < needed
            before, after = np.searchsorted(chosen, numbers, side="right") - 1, np.searchsorted(chosen, numbers)
            own = found[before]
            differ = np.flatnonzero(own != found[after])
            if len(differ):
                own[differ] = each.measure_poses(points[differ], axes[differ], needed) < needed
            shaded |= own
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

    def bound(self, points: Floats, axes: Floats, needed: float) -> tuple[Floats, Floats]:
        """Two distances (N,) for the poses at ``points`` (N,3) with ``axes`` (N,3): the true one lies between them.

        They are only as near to each other as it takes to see whether the nozzle keeps the distance ``needed``. Both
        are 0 where something stands in the beam.
        """
        low, high = self._bound_body(points, axes, needed)
        for each in self.beams:
            assert self.beam is not None
            least, most = each.bound(points, axes, self.beam.needed)
            low[least < self.beam.needed] = 0.0
            high[most < self.beam.needed] = 0.0
        return low, high

    def _bound_body(self, points: Floats, axes: Floats, needed: float, is_tight: bool = True) -> tuple[Floats, Floats]:
        """As `bound`, without the beam. ``is_tight``: see `Descent.bound`."""
        if self.descent is None:
            alone = self.obstacles is None or self.obstacles.boxes is None
            return np.full(len(points), np.inf if alone else 0.0), np.full(len(points), np.inf)
        low, high = self.descent.bound(points + self.standoff * axes, axes, needed + self.detail, is_tight)
        return np.maximum(low - self.detail, 0.0), np.maximum(high - self.detail, 0.0)

    @cached_property
    def descent(self) -> Descent | None:
        """What finds the bounds; None without obstacles, and for a nozzle that is no solid of revolution."""
        if self.obstacles is None or self.obstacles.boxes is None or self.nozzle.profile is None:
            return None
        return Descent(self.obstacles.boxes, self.nozzle.profile, self.endless, self.floor, self.until)

    def measure_poses(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """For each pose (N,) a distance that the nozzle keeps at least; below ``needed`` only where it really is, or
        where it is more by less than the share `CLOSE`.

        ``points``, ``axes`` (N,3): as in `bound`. 0 where something stands in the beam.
        """
        found = self._measure_body(points, axes, needed)
        open_ = np.flatnonzero(found >= needed)
        if self.beam is not None and len(open_):
            found[open_[self.find_shaded(points[open_], axes[open_])]] = 0.0
        return found

    def _measure_body(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """As `measure_poses`, without the beam."""
        far = _add_up(self.bound_moves(points, axes))
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
        low, high = self._bound_body(points, axes, needed, is_tight=False)
        found = np.where(high < needed, high, low)
        known, at = -np.inf, 0.0
        for k in np.flatnonzero((low < needed) & (high >= (1 + CLOSE) * needed)):
            if known - (far[k] - at) < needed:
                ranks = self._list_near_ranks(points[k], axes[k], needed)
                known, at = self.measure(points[k], axes[k], ranks), float(far[k])
                if ranks is not None:  # the others are farther than that
                    known = min(known, ENOUGH * needed)
            found[k] = known - (far[k] - at)
        return found

    def _list_near_ranks(self, point: Floats, axis: Floats, needed: float) -> Ints | None:
        """The ranks (K,) of what may be near at a pose; None for all."""
        if self.descent is None or self.obstacles is None or self.obstacles.ranks[-1] == self.obstacles.ranks[0]:
            return None
        return self.descent.list_near_ranks(point + self.standoff * axis, axis, needed + self.detail)

    def bound_moves(self, points: Floats, axes: Floats) -> Floats:
        """How far (N-1,) any point of the nozzle moves at most from each pose of a path to the next, ``points`` and
        ``axes`` (N,3)."""
        return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1) + self.bound_turns(axes))

    def bound_turns(self, axes: Floats) -> Floats:
        """How far (N-1,) any point of the nozzle moves at most while its axis turns from each of ``axes`` (N,3) to the
        next about the point it works on."""
        chord = np.linalg.norm(np.diff(axes, axis=0), axis=1)
        return np.asarray(2 * np.arcsin(np.clip(chord / 2, 0, 1)) * self.reach)


def _add_up(moves: Floats) -> Floats:
    """The way (N,) to each pose of a path, from the moves (N-1,) between them."""
    return np.concatenate([[0.0], np.cumsum(moves)])


def _choose_poses(far: Floats, spacing: float) -> Ints:
    """The first and the last pose of a way, and of those between as few as keep a ``spacing`` at most where the way
    ``far`` (N,) to each permits it."""
    number = np.arange(len(far))
    after = np.maximum(np.searchsorted(far, far + spacing, side="right") - 1, number + 1).tolist()
    chosen = [0]
    while chosen[-1] < len(far) - 1:
        chosen.append(after[chosen[-1]])
    return np.array(chosen)


def _carry_over(found: Floats, far: Floats, known: Ints, needed: float) -> Floats:
    """Distances (N,) of poses that follow from those at the ``known`` ones and the way ``far`` (N,) between them."""
    number = np.searchsorted(known, np.arange(len(found)), side="right")
    before, after = known[np.maximum(number - 1, 0)], known[np.minimum(number, len(known) - 1)]
    implied = np.maximum(found[before] - np.abs(far - far[before]), found[after] - np.abs(far - far[after]))
    return np.where((found == -np.inf) & (implied >= needed), implied, found)
