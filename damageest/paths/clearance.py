"""How far the nozzle stays from what it must not touch: exact distances of triangles, by the FCL library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.paths.nozzle import turn_to_axis


def _make_tree(mesh: Mesh) -> Any:
    """FCL's tree of boxes over the triangles of a mesh."""
    import fcl

    tree = fcl.BVHModel()
    tree.beginModel(len(mesh.vertices), len(mesh.faces))
    tree.addSubModel(np.ascontiguousarray(mesh.vertices), np.ascontiguousarray(mesh.faces))
    tree.endModel()
    return tree


class Obstacle:
    """A mesh prepared for distances to the nozzle, in coordinates near the origin."""

    def __init__(self, mesh: Mesh) -> None:
        import fcl

        self.object = fcl.CollisionObject(_make_tree(mesh), fcl.Transform())


@dataclass
class Clearance:
    """The distance between a nozzle and obstacles.

    ``nozzle``: a closed mesh, tip at 0, axis along z. ``standoff``: how far the tip is above the point that it works
    on. ``detail``: how far the obstacles may lie from what they stand for; it is taken off each distance. ``reach``:
    the farthest point of the nozzle from the point that it works on.
    """

    nozzle: Mesh
    standoff: float
    obstacles: Sequence[Obstacle]
    detail: float = 0.0
    reach: float = field(init=False)

    def __post_init__(self) -> None:
        import fcl

        self._moving = fcl.CollisionObject(_make_tree(self.nozzle), fcl.Transform())
        far = self.nozzle.vertices + np.array([0, 0, self.standoff])
        self.reach = float(np.linalg.norm(far, axis=1).max())

    def with_obstacles(self, obstacles: Sequence[Obstacle]) -> Clearance:
        """The same nozzle among other obstacles."""
        return Clearance(self.nozzle, self.standoff, obstacles, self.detail)

    def measure(self, point: Floats, axis: Floats) -> float:
        """Distance between the nozzle, working on ``point`` (3,) with its axis along ``axis`` (3,), and the obstacles.

        0 where they touch or overlap; inf without obstacles.
        """
        import fcl

        self._moving.setTransform(fcl.Transform(turn_to_axis(axis), point + self.standoff * axis))
        found = np.inf
        for obstacle in self.obstacles:
            found = min(found, fcl.distance(obstacle.object, self._moving, fcl.DistanceRequest(), fcl.DistanceResult()))
        return max(float(found) - self.detail, 0.0)

    def measure_along(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """A distance (N,) that the nozzle keeps at least at each of ``points`` (N,3), with the axes (N,3).

        Where it is below ``needed`` it is exact. Points are left out of the computation that cannot be so near, judging
        by the distance at an earlier one and the way from there.
        """
        moves = np.linalg.norm(np.diff(points, axis=0), axis=1) + self.bound_turns(axes)
        found = np.empty(len(points))
        known, since = -np.inf, 0.0
        for k in range(len(points)):
            since += moves[k - 1] if k else 0.0
            if known - since < 1.2 * needed:
                known, since = self.measure(points[k], axes[k]), 0.0
            found[k] = known - since
        return found

    def bound_turns(self, axes: Floats) -> Floats:
        """How far (N-1,) any point of the nozzle moves at most while its axis turns from each of ``axes`` (N,3) to the
        next about the point it works on."""
        chord = np.linalg.norm(np.diff(axes, axis=0), axis=1)
        return np.asarray(2 * np.arcsin(np.clip(chord / 2, 0, 1)) * self.reach)
