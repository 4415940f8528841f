"""Bounds on the distance of a nozzle that is a solid of revolution.

A point's distance to such a nozzle follows from a formula. Each box of a tree stands for the surface that it holds.
Where that does not decide, the triangles are cut into smaller pieces. The loops stand in `loops`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest_paths.clearance.boxes import Boxes

ENOUGH = 1.5
"""Multiple of the needed distance from which a distance need not be known well."""


@dataclass(frozen=True, eq=False)
class Descent:
    """A nozzle with this ``profile`` (K,2) among the ``boxes`` of obstacles. ``floor``: a height below which they do
    not count; ``until``: the last rank of those that stand; ``endless``: the nozzle's body goes on above its end."""

    boxes: Boxes
    profile: Floats
    endless: bool
    floor: float
    until: int

    @cached_property
    def _shape(self) -> Floats:
        from damageest_paths.clearance.loops import describe_shape

        return describe_shape(self.profile, self.endless)

    def bound(self, tips: Floats, axes: Floats, needed: float, is_tight: bool = True) -> tuple[Floats, Floats]:
        """Two distances (N,) for poses with ``tips`` and ``axes`` (N,3): the true one lies between them. They are only
        as near to each other as it takes to see whether ``needed`` is kept; the lower one is 0 where it is not.

        ``is_tight``: whether the upper distance counts where it is below ``needed``; else it may be larger there.
        """
        from damageest_paths.clearance.compiling import run_loops
        from damageest_paths.clearance.loops import bound_poses

        low, high = np.empty(len(tips)), np.empty(len(tips))
        tips, axes = np.ascontiguousarray(tips), np.ascontiguousarray(axes)
        run_loops(
            bound_poses, tips, axes, self._shape, needed, ENOUGH * needed, is_tight, self.boxes.tree, self.floor,
            self.until, low, high,
        )  # fmt: skip
        return low, high

    def bound_stretches(
        self, points: Floats, axes: Floats, standoff: float, shift: Floats, turn: Floats, needed: float
    ) -> Floats:
        """A distance (N,) that the nozzle keeps at least while the point it works on stays within ``shift`` (N,) of
        each of ``points`` (N,3), and its axis within the angle ``turn`` (N,) of ``axes`` (N,3). Its tip is ``standoff``
        above that point.

        Distances are not computed well where they are larger than ``needed``; -inf where it is not kept.
        """
        from damageest_paths.clearance.compiling import run_loops
        from damageest_paths.clearance.loops import bound_stretches

        found = np.empty(len(points))
        points, axes = np.ascontiguousarray(points), np.ascontiguousarray(axes)
        run_loops(
            bound_stretches, points, axes, standoff, shift, turn, self._shape, needed, self.boxes.tree, self.floor,
            self.until, found,
        )  # fmt: skip
        return found

    def list_near_ranks(self, tip: Floats, axis: Floats, needed: float) -> Ints:
        """The ranks (K,) of what may be nearer than `ENOUGH` times ``needed`` at a pose with ``tip`` and ``axis``
        (3,)."""
        from damageest_paths.clearance.compiling import run_loops
        from damageest_paths.clearance.loops import mark_near_ranks

        near = np.zeros(int(self.boxes.rank.max()) + 1, bool)
        run_loops(
            mark_near_ranks, np.ascontiguousarray(tip), np.ascontiguousarray(axis), self._shape, ENOUGH * needed,
            self.boxes.tree, self.floor, self.until, near,
        )  # fmt: skip
        return np.flatnonzero(near)
