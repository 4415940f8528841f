"""Distances of the nozzle: bounds that hold, however the obstacles lie."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles
from damageest_paths.process.frames import make_frame
from damageest_paths.tool.nozzle import Cone, make_nozzle

from damageest.artefacts import Floats, Mesh

LOW, HIGH = np.array([-5.0, -5, -5]), np.array([5.0, 5, 0])


def make_obstacles() -> Obstacles:
    ball = trimesh.creation.icosphere(3, 8.0).apply_translation((6, 3, 12))
    plate = trimesh.creation.box((40, 40, 4), transform=trimesh.transformations.translation_matrix((0, 0, -4)))
    meshes = [Mesh(np.asarray(each.vertices), np.asarray(each.faces, np.int64)) for each in (ball, plate)]
    return Obstacles(meshes, LOW, HIGH, 2.0)


def make_poses(count: int) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(5)
    points = rng.uniform((-10, -10, -1), (10, 10, 6), (count, 3))
    axes = rng.normal(size=(count, 3)) * [0.5, 0.5, 0] + [0, 0, 1]
    return points, axes / np.linalg.norm(axes, axis=1)[:, None]


@pytest.mark.parametrize(("turned", "length"), [(False, 30.0), (True, 30.0), (False, 6.0)])
def test_the_true_distance_lies_between_the_bounds(turned: bool, length: float) -> None:
    """A short nozzle has things behind it, which it does not touch."""
    obstacles, (points, axes) = make_obstacles(), make_poses(300)
    if turned:
        turn = make_frame((1.0, 2.0, 2.0), np.zeros(3)).turn
        obstacles, points, axes = obstacles.turn(turn), points @ turn.T, axes @ turn.T
    clearance = Clearance(make_nozzle(Cone(1.0, 4.0, length, np.radians(20))), 3.0, obstacles).during_travel()
    low, high = clearance.bound(points, axes, 0.8)
    exact = np.array([clearance.measure(*pose) for pose in zip(points, axes, strict=True)])
    assert 20 < (exact < 0.8).sum() < 280
    assert (low <= exact + 1e-9).all()
    # the nozzle's mesh is within the solid of revolution by 0.5 % of its radius; touching is 0 for both
    assert (high >= exact - 0.03).all()
    assert (high[exact < 0.5] < 0.8).all()
    assert (low[exact > 4.0] >= 0.8).all()


def test_what_lies_below_the_floor_does_not_count() -> None:
    obstacles, (points, axes) = make_obstacles(), make_poses(50)
    clearance = Clearance(make_nozzle(Cone(1.0, 4.0, 30.0, np.radians(20))), 3.0, obstacles)
    low, high = clearance.above(100.0).bound(points, axes, 0.8)
    assert np.isinf(low).all()
    assert np.isinf(high).all()


def test_the_bounds_decide_close_to_the_true_distance() -> None:
    """Without the exact distance, however near the needed one it is: surfaces are cut until they are small enough."""
    obstacles, (points, axes) = make_obstacles(), make_poses(200)
    clearance = Clearance(make_nozzle(Cone(1.0, 4.0, 30.0, np.radians(20))), 3.0, obstacles).during_travel()
    checked = 0
    for point, axis in zip(points, axes, strict=True):
        exact = clearance.measure(point, axis)
        if 0.1 < exact < 4:
            # the nozzle's mesh is within the solid of revolution by 0.5 % of its radius
            (low,), _ = clearance.bound(point[None], axis[None], exact - 0.025)
            _, (high,) = clearance.bound(point[None], axis[None], exact + 0.005)
            assert low >= exact - 0.025
            assert high < exact + 0.005
            checked += 1
    assert checked > 40


def test_of_a_large_triangle_only_what_lies_above_the_floor_counts() -> None:
    """The nozzle touches a ramp below the floor; above the floor the ramp, in a few large triangles, is 3 away."""
    x, z = np.array([-25.0, 35.0]), np.array([-11.0, 13.0])
    corners = np.array([[x[k], y, z[k]] for k in range(2) for y in (-40.0, 40.0)])
    ramp = Mesh(corners, np.array([[0, 2, 1], [1, 2, 3]]))
    far = np.full(3, -100.0)
    clearance = Clearance(make_nozzle(Cone(1.0, 4.0, 30.0, np.radians(20))), 3.0, Obstacles([ramp], far, far + 1, 2.0))
    pose = np.array([[5.0, 0.0, -2.0]]), np.array([[0.0, 0.0, 1.0]])
    assert clearance.bound(*pose, 0.8)[1] < 0.8
    low, high = clearance.above(3.0).bound(*pose, 0.8)
    assert low >= 0.8
    assert high > 2.5
    assert clearance.above(3.0).measure_poses(*pose, 0.8) >= 0.8
