"""A deposit in parts with a build direction each, and what stands already while the nozzle travels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_built, measure_nozzle
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.obstacles import Obstacles, draw_passes
from damageest_paths.fill.regions import cover, make_region
from damageest_paths.process.process import Pass
from damageest_paths.tool.nozzle import Cone, Nozzle, make_nozzle, make_nozzle_mesh
from damageest_paths.travel.exits import Travel
from damageest_paths.travel.moves import Moves, join_passes
from manifold3d import Manifold

from damageest.artefacts import Floats, Mesh
from damageest.geometry.solids import to_arrays
from tests.path_shapes import BLOCK, Loss, cut, plan

UP = np.array([0.0, 0.0, 1.0])


def make_lip_and_boss() -> Loss:
    """A lip that hangs out of the side of a block, and a boss on its top, behind a wall: no direction reaches both."""
    lip = Manifold.cube((6, 20, 4)).translate((20, -10, -10))
    boss = Manifold.cube((14, 14, 3)).translate((-12, -7, 0))
    wall = Manifold.cube((3, 30, 14)).translate((8, -15, 0))
    return cut(BLOCK + wall + lip + boss, lip + boss)


@pytest.mark.slow
def test_three_and_two_axes_build_parts_with_a_direction_each() -> None:
    """Also where a slanting direction reaches a little of both, and leaves of each what no other one reaches."""
    loss = make_lip_and_boss()
    three = plan(loss, axes=3, layers="auto")
    parts = plan(loss, axes="3+2", layers="auto", machine={"tilt": 89.9})
    assert three.unreached_volume > 0.05 * loss.lost.volume
    assert parts.unreached_volume < 0.5 * three.unreached_volume
    assert len(parts.directions) >= 2
    assert parts.directions[0] @ parts.directions[1] < 0.99
    for number, direction in enumerate(parts.directions, 1):
        own = parts.on & (parts.part == number)
        assert own.any()
        assert np.allclose(parts.axes[own], direction)
        assert np.allclose(parts.normals[own], direction)
    least = min(parts.clearance, parts.travel_clearance)
    assert measure_nozzle(parts, loss.left, 0.1) >= 0.75 * least > 0
    assert measure_built(parts, 0.1) >= 0.75 * least


def make_pass(x: float, top: float, layer: int) -> Pass:
    points = np.array([[x, -10.0, top], [x, 10.0, top]])
    return Pass(points, np.tile(UP, (2, 1)), np.tile(UP, (2, 1)), layer)


FAR_AWAY = np.array([[1000.0, 1000.0, 1000.0]])
"""Corners so far that the tool leaves by the sphere."""


def measure_way(obstacles: Obstacles | None, passes: list[Pass], stays: bool = False) -> tuple[Floats, float]:
    """The points of the travel from the second pass to the third, and the least distance on the way."""
    nozzle = make_nozzle(Cone(1.0, 4.0, 40.0, np.radians(20)))
    travel = Travel(1.0, 100.0, np.zeros(3), 0.5, 600.0, 3000.0, FAR_AWAY, 1.0, stays)
    moves = join_passes([passes], Clearance(nozzle, 2.0, obstacles), travel)
    return moves.points[(moves.number == 3) & ~moves.on][:-1], moves.gap


def test_travel_keeps_clear_of_layers_that_stand() -> None:
    """A wall of beads, 8 high, stands between two passes at its foot."""
    wall, left, right = make_pass(0.0, 8.0, 0), make_pass(-9.0, 0.0, 1), make_pass(9.0, 0.0, 1)
    mesh = draw_passes([wall], 2.0, 8.0)
    low, high = np.array([-10.0, -12, 0]), np.array([10.0, 12, 8])
    passes = [wall, left, right]
    straight, _ = measure_way(None, passes)
    over, gap = measure_way(Obstacles([mesh], low, high, 2.0, [1]), passes)
    assert straight[:, 2].max() == 1.0
    # the tip is 2 above the point, and keeps half of the gap from the wall
    assert over[:, 2].max() > 8 - 2 + 0.25
    assert 0.25 <= gap < np.inf
    later, _ = measure_way(Obstacles([mesh], low, high, 2.0, [3]), passes)
    assert later[:, 2].max() == 1.0
    down, _ = measure_way(None, passes, stays=True)
    assert down[:, 2].max() == 0.0
    over, gap = measure_way(Obstacles([mesh], low, high, 2.0, [1]), passes, stays=True)
    assert over[:, 2].max() > 8 - 2 + 0.25
    assert gap >= 0.25


def test_the_tool_comes_and_leaves_above_everything_along_its_axis() -> None:
    nozzle = make_nozzle(Cone(1.0, 4.0, 40.0, np.radians(20)))
    corners = np.array([[-30.0, 0.0, 7.0], [30.0, 0.0, -60.0]])
    travel = Travel(1.0, 100.0, np.zeros(3), 0.5, 600.0, 3000.0, corners, 2.0)
    moves = join_passes([[make_pass(0.0, 0.0, 0)]], Clearance(nozzle, 2.0), travel)
    assert moves.points[[0, -1], 2].tolist() == [9.0, 9.0]


def test_beads_are_drawn_as_they_lie() -> None:
    from damageest.artefacts import Solid

    mesh = draw_passes([make_pass(3.0, 2.0, 0)], 2.0, 0.5)
    solid = Solid(mesh.vertices, mesh.faces)
    assert np.allclose(solid.bounds, np.array([[2, -11, 1.5], [4, 11, 2]]), atol=0.05)
    assert np.isclose(solid.volume, (20 * 2 + np.pi) * 0.5, rtol=0.03)


@pytest.mark.parametrize("seed", range(4))
def test_drawn_beads_hold_all_that_beads_cover_and_little_more(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turns = np.cumsum(rng.choice([0.0, 0.3, -0.4, 0.7, 1.5, -2.5], 30))
    steps = rng.choice([0.2, 1.0, 5.0], 30)[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    line = np.column_stack([np.cumsum(steps, axis=0), np.full(30, 2.0)])
    up = np.tile(UP, (30, 1))
    passes = [Pass(line[own], up[own], up[own], 0) for own in (slice(17), slice(17, None))]
    mesh = draw_passes(passes, 2.0, 0.5)
    assert mesh.vertices[:, 2].min() == pytest.approx(1.5)
    flat = mesh.vertices[:, :2][mesh.faces]
    one, other = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    drawn = make_region(list(flat[area > 1e-9]))
    beads = cover([one.points[:, :2] for one in passes], 2.0)
    assert (beads - drawn.offset(1e-6)).area() < 1e-6
    assert (drawn - beads.offset(0.1 * 2.0)).area() < 1e-6


def test_the_check_sees_a_nozzle_in_beads() -> None:
    loss = cut(BLOCK, Manifold.sphere(8, 64).translate((0, 0, 6)))
    path = plan(loss, direction=UP, simulate=False)
    assert measure_built(path, 4.0) >= 0.25
    lower = replace(path, standoff=0.001, axes=path.axes * [1, 1, -1])
    assert measure_built(lower, 0.5) == 0


def leave(obstacle: Manifold, x: float = 2.0) -> Moves:
    """The moves of two passes, the second at ``x`` with the tool leaning towards x, beside an obstacle."""
    lean = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    passes = [make_pass(0.0, 0.0, 0), replace(make_pass(x, 0.0, 0), axes=np.tile(lean, (2, 1)))]
    mesh = Mesh(*to_arrays(obstacle))
    near = Obstacles([mesh], np.array([-35.0, -12, -5]), np.array([5.0, 12, 5]), 2.0)
    nozzle = Nozzle(make_nozzle_mesh(Cone(1.0, 4.0, 40.0, np.radians(20))))  # as long as its mesh
    travel = Travel(1.0, 100.0, np.zeros(3), 0.5, 600.0, 3000.0, FAR_AWAY, 1.0)
    return join_passes([passes], Clearance(nozzle, 2.0, near), travel)


def test_the_tool_leaves_where_it_is_clear() -> None:
    beyond = Manifold.cube((20, 60, 60), True).translate((75, 0, 60))
    moves = leave(beyond)
    assert moves.blocked == 0
    assert moves.gap >= 0.25
    assert np.allclose(moves.axes[-1], UP)
    assert np.linalg.norm(moves.points[-1]) == pytest.approx(100)


def test_the_tool_leaves_from_above_another_pass() -> None:
    """A roof over the second pass, so low that the tool cannot be upright under it."""
    wall = Manifold.cube((20, 60, 60), True).translate((75, 0, 60))
    roof = Manifold.cube((16, 60, 5)).translate((-32, -30, 34))
    moves = leave(wall + roof, -25.0)
    assert moves.blocked == 0
    assert moves.gap >= 0.25
    assert np.allclose(moves.axes[-1], UP)
    assert moves.points[-1][0] == pytest.approx(0)


@pytest.mark.slow
def test_a_way_out_that_is_blocked_is_counted() -> None:
    room = Manifold.cube((190, 190, 190), True) - Manifold.cube((160, 160, 160), True)
    moves = leave(room)
    assert moves.blocked == 2  # the way in, and the way out
    assert moves.gap == 0
