"""Layers along the floor of a cavity: on known surfaces, filled, supported, and as planes on a flat floor."""

from __future__ import annotations

from functools import cache
from typing import Any, cast

import numpy as np
import pytest
from damageest_paths.fill.regions import measure_length
from damageest_paths.layering.conformal import plan_conformal
from damageest_paths.layering.planar import plan_planar
from damageest_paths.process.process import Pass, Plan
from damageest_paths.sheets.floor import Depth, Floor
from damageest_paths.sheets.sheets import Sheet, SheetTree
from manifold3d import Manifold
from path_cavities import (
    BALL,
    BORE,
    DEPTH,
    SUNK,
    bowl,
    crescent,
    funnel,
    groove,
    ledge,
    low_stair,
    pocket,
    prepare,
    stair,
    tip,
)

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest.geometry.solids import to_solid
from tests.path_shapes import BLOCK, Loss, cut
from tests.path_shapes import plan as plan_whole

MAKERS = {"groove": groove, "bowl": bowl, "pocket": pocket, "tip": tip}


@cache
def plan_cavity(name: str) -> tuple[Loss, Plan]:
    loss = MAKERS[name]()
    scene = prepare(loss)
    return loss, plan_conformal(scene.body, scene.frame, scene.around, scene.process)


def to_part(plan: Plan, points: Floats) -> Floats:
    return plan.frame.to_part(points + (plan.frame.to_local(plan.frame.origin[None])))


def sample(one: Pass) -> Floats:
    """Points of a pass and between them."""
    return np.concatenate([one.points[:-1], (one.points[1:] + one.points[:-1]) / 2, one.points[-1:]])


def list_layers(plan: Plan) -> list[tuple[int, Floats]]:
    numbers = sorted({one.layer for one in plan.passes})
    return [(k, to_part(plan, np.concatenate([sample(one) for one in plan.passes if one.layer == k]))) for k in numbers]


@pytest.mark.slow
def test_layers_of_a_bore_are_cylinders_about_its_axis() -> None:
    _, plan = plan_cavity("groove")
    assert plan.height == pytest.approx(DEPTH / 3, rel=0.01)
    layers = list_layers(plan)
    assert len(layers) == 3
    for number, points in layers:
        radius = np.linalg.norm(points[:, [0, 2]], axis=1)
        # the bore's tessellation of 256 sides is off by 1.7e-3
        assert radius == pytest.approx(np.full(len(points), BORE + DEPTH - (number + 1) * plan.height), abs=0.01)


@pytest.mark.slow
def test_layers_of_a_bowl_are_spheres_about_its_centre() -> None:
    _, plan = plan_cavity("bowl")
    for number, points in list_layers(plan):
        radius = np.linalg.norm(points - [0, 0, BALL - SUNK], axis=1)
        assert radius == pytest.approx(np.full(len(points), BALL - (number + 1) * plan.height), abs=0.02)


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", MAKERS)
def test_each_point_is_as_far_from_the_floor_as_its_layer(name: str) -> None:
    scene = prepare(MAKERS[name]())
    _, plan = plan_cavity(name)
    for one in plan.passes:
        depth = scene.floor.measure(one.points).distance
        assert depth == pytest.approx(np.full(len(depth), (one.layer + 1) * plan.height), abs=0.01)


@pytest.mark.slow
def test_the_tool_follows_the_normal_up_to_its_limit() -> None:
    scene = prepare(groove(), tilt=np.radians(30.0))
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    for one in plan.passes:
        places = to_part(plan, one.points)
        true = np.column_stack([-places[:, 0], 0 * places[:, 0], -places[:, 2]])
        true /= np.linalg.norm(true, axis=1)[:, None]
        assert np.einsum("ij,ij->i", one.normals, true).min() > np.cos(np.radians(3.0))
        tilt = np.degrees(np.arccos(one.axes[:, 2]))
        assert tilt.max() < 30.01
        inner = np.degrees(np.arccos(np.clip(true[:, 2], -1, 1))) < 29
        assert np.einsum("ij,ij->i", one.axes, true)[inner].min() > np.cos(np.radians(3.0))


def test_a_flat_floor_gives_planes() -> None:
    scene = prepare(pocket(), axes=3, gap=0.2)
    planar, found = (
        make(scene.body, scene.frame, scene.around, scene.process) for make in (plan_planar, plan_conformal)
    )
    assert found.height == pytest.approx(planar.height)
    tops = np.unique(np.concatenate([np.round(one.points[:, 2], 6) for one in planar.passes]))
    for one in found.passes:
        assert np.abs(one.points[:, 2, None] - tops).min(axis=1).max() < 1e-6
        assert one.axes == pytest.approx(np.tile([0.0, 0.0, 1.0], (len(one.axes), 1)))
    lengths = [sum(measure_length(one.points) for one in plan.passes) for plan in (planar, found)]
    assert lengths[1] == pytest.approx(lengths[0], rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("pattern", ["contour", "spiral", pytest.param("offset-zigzag", marks=pytest.mark.slow)])
def test_rows_and_rings_are_a_step_apart_on_the_surface(pattern: Any) -> None:
    """The beads, 2 wide and drawn on the bowl, leave nothing of it."""
    scene = prepare(bowl(), pattern=pattern)
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    assert plan.missing_volume < 1e-3 * scene.body.volume()
    centre = np.array([0, 0, BALL - SUNK])
    first = to_part(plan, np.concatenate([sample(one) for one in plan.passes if one.layer == 0]))
    reach = BALL - plan.height
    angle, turn = np.meshgrid(np.linspace(0, 0.8, 40), np.linspace(0, 2 * np.pi, 60))
    ball = np.stack([np.sin(angle) * np.cos(turn), np.sin(angle) * np.sin(turn), -np.cos(angle)], axis=-1).reshape(
        -1, 3
    )
    away = np.linalg.norm((centre + reach * ball)[:, None] - first[None], axis=2).min(axis=1)
    inside = (centre + (reach + plan.height / 2) * ball)[:, 2] < -0.1
    assert inside.any()
    assert away[inside].max() <= 1.05, "half of a bead's width, and the points' distance along the pass"


def test_nothing_hangs_in_the_air() -> None:
    """A ledge over an open side: only what the overhang permits of it is held."""
    body = Manifold.cube((10, 10, 3)) + Manifold.cube((10, 14, 1)).translate((0, 0, 2))
    loss = cut(body + Manifold.cube((10, 10, 5)).translate((0, 0, -5)), body)
    scene = prepare(loss, axes=3)
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    hanging = sum(volume for why, volume in plan.reasons.items() if "stands on nothing" in why)
    # 4 wide, of which as much is held as the layer is high
    assert hanging == pytest.approx(10 * 3 * 1, rel=0.15)
    assert plan.missing_volume == pytest.approx(sum(plan.reasons.values()))


@cache
def make_walled_notch() -> Loss:
    """A notch in the edge of a block, with a wall before it: along the mean normal of its open sides the nozzle meets
    the wall, from above it reaches most."""
    notch = Manifold.cube((14, 8, 7)).translate((14, -4, -4))
    wall = Manifold.cube((6, 60, 40)).translate((34, -30, -20)) + Manifold.cube((60, 60, 10)).translate((-20, -30, -30))
    lost, left = to_solid(BLOCK ^ notch), to_solid(BLOCK - notch + wall)
    assert lost is not None
    assert left is not None
    return Loss(lost, left)


@pytest.mark.slow
def test_a_tool_that_goes_over_from_lean_to_lean_reaches_more_than_half() -> None:
    path = plan_whole(make_walled_notch(), layers="conformal", axes=5, direction="normal", simulate=False)
    assert 0.1 * path.deposit_volume < path.unreached_volume < 0.5 * path.deposit_volume


@pytest.mark.slow
def test_of_the_build_directions_that_is_taken_which_fills_far_more() -> None:
    path = plan_whole(make_walled_notch(), layers="conformal", axes=5, direction="auto", simulate=False)
    assert path.unreached_volume < 0.1 * path.deposit_volume
    assert path.directions[0] == pytest.approx([0, 0, 1])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loss", "width", "height"),
    [(crescent(5.0, 3.0), 1.4, 0.5), pytest.param(crescent(18.0, 16.0), 1.0, 0.35, marks=pytest.mark.slow)],
    ids=["small", "large"],
)
def test_a_round_floor_is_followed_as_far_as_it_is_not_upright(loss: Loss, width: float, height: float) -> None:
    path = plan_whole(
        loss, direction=(0.0, 0.0, 1.0), axes=5, layers="conformal", width=width, height=height, machine={"tilt": 80}
    )
    assert path.unreached_volume < 0.004 * path.deposit_volume
    assert path.fill is not None
    assert path.fill.filled > 0.99


def test_walls_that_lean_are_no_floor() -> None:
    """The floor alone is followed: layers up the walls too would leave a quarter unfilled."""
    scene = prepare(funnel())
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    assert plan.passes
    tops = {one.layer: np.unique(np.round(one.points[:, 2], 2)) for one in plan.passes}
    assert all(len(heights) == 1 for heights in tops.values())


def test_a_floor_with_a_step_is_refused() -> None:
    scene = prepare(stair())
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    assert not plan.passes
    assert [why for why in plan.reasons if "steps" in why]
    assert plan.missing_volume == pytest.approx(scene.body.volume())


@pytest.mark.slow
def test_a_scrap_of_floor_on_a_wall_is_not_followed() -> None:
    """Scans leave such scraps; each made a cliff of the layers, and they were refused."""
    scene = prepare(ledge())
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    assert len({one.layer for one in plan.passes}) == 6
    tops = {one.layer: np.ptp(one.points[:, 2]) for one in plan.passes}
    assert max(tops.values()) < 1e-3
    assert plan.missing_volume < 0.04 * scene.body.volume()


@pytest.mark.slow
def test_layers_are_torn_at_a_low_step_and_what_has_no_bead_there_is_told() -> None:
    scene = prepare(low_stair())
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    first = [one.points[:, 2] for one in plan.passes if one.layer == 0]
    assert {round(float(heights.mean()), 3) for heights in first} == {-1.0, 1.0}
    assert max(np.ptp(heights) for heights in first) < 1e-3
    told = sum(volume for why, volume in plan.reasons.items() if "step" in why)
    assert 0.02 < told / scene.body.volume() < 0.07
    beads = sum(measure_length(one.points) for one in plan.passes) * scene.process.bead.step * plan.height
    assert beads + plan.missing_volume > 0.9 * scene.body.volume()


@pytest.mark.slow
def test_another_plan_is_asked_for_before_beads_are_laid() -> None:
    """What no layer covers is known by then, and is the least that can be missing."""
    scene = prepare(low_stair())
    given = scene.body, scene.frame, scene.around, scene.process
    asked: list[float] = []
    plan = plan_conformal(*given, find_other=asked.append)
    told = sum(volume for why, volume in plan.reasons.items() if "step" in why)
    assert asked == [pytest.approx(told, rel=0.05)]
    assert plan_conformal(*given, find_other=lambda least: plan) is plan


def make_slot(width: float) -> Loss:
    block = BLOCK ^ Manifold.cube((60, 6, 60), True)
    return cut(block, Manifold.cube((width, 60, 20)).translate((-width / 2, -30, -8)))


@pytest.mark.slow
def test_layers_that_would_leave_more_than_half_are_refused() -> None:
    """A deep slot: the nozzle does not come to its bottom, and what lies above has nothing to stand on."""
    narrow = make_slot(3.0)
    scene = prepare(narrow, axes=3)
    plan = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    assert not plan.passes
    assert [why for why in plan.reasons if "more than half" in why]
    assert plan.missing_volume == pytest.approx(scene.body.volume())
    with pytest.raises(StageError, match="more than half of it without a bead"):
        plan_whole(narrow, layers="conformal", axes=3)


@pytest.mark.slow
def test_layers_that_leave_little_of_a_slot_are_not_refused() -> None:
    path = plan_whole(make_slot(8.0), layers="conformal", axes=5, simulate=False)
    assert path.unreached_volume < 0.5 * path.deposit_volume


def test_no_floor_no_passes() -> None:
    scene = prepare(pocket())
    plan = plan_conformal(scene.body.translate((0, 0, 30)), scene.frame, scene.around, scene.process)
    assert not plan.passes
    assert [why for why in plan.reasons if "faces the build direction" in why]


@pytest.mark.slow
def test_the_same_twice() -> None:
    scene, (_, first) = prepare(tip()), plan_cavity("tip")
    second = plan_conformal(scene.body, scene.frame, scene.around, scene.process)
    assert [one.points.tobytes() for one in first.passes] == [one.points.tobytes() for one in second.passes]
    assert [one.axes.tobytes() for one in first.passes] == [one.axes.tobytes() for one in second.passes]


def test_a_place_far_from_the_depth_of_its_sheet_stays_between_its_neighbours() -> None:
    """Over a place at which two sides of the floor are as near, the depth jumps: passes were laid 1.5 mm off there."""
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    number = np.arange(25).reshape(5, 5)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack(one, axis=-1).reshape(-1, 3) for one in ((a, b, c), (a, c, d))])
    points, up = np.column_stack([places, np.full(25, 1.1)]), np.tile([0.0, 0.0, 1.0], (25, 1))

    class Jump:
        def measure(self, at: Floats) -> Depth:
            return Depth(np.where(at[:, 0] > 2, at[:, 2] + 3, at[:, 2]), np.tile([0.0, 0.0, 1.0], (len(at), 1)))

    sheet = Sheet(1.0, points, up, up, np.ones(25, bool))
    tree = SheetTree(sheet, cast(Floor, Jump()), places, faces, np.arange(25))
    found = tree.find(np.array([[1.5, 1.5], [2.5, 1.5]]))[0]
    assert found[:, 2] == pytest.approx([1.0, 1.1])
