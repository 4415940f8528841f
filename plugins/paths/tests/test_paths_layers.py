"""Passes layer by layer: they fill the deposit, keep the nozzle clear, and say what they leave."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_nozzle
from damageest_paths.layers import Layers
from manifold3d import Manifold
from path_cavities import bowl, groove, stair, tip
from pydantic import ValidationError

from damageest.artefacts import DepositPath, Mesh, Solid
from damageest.errors import StageError
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.transforms import turn_to_axis
from tests.path_shapes import BLOCK, NOZZLE, OPTIONS, TOLERANCE, Loss, corner, cut, dent, plan

UP = (0.0, 0.0, 1.0)


@cache
def plan_dent() -> DepositPath:
    return plan(dent(), direction=UP)


def measure_others(path: DepositPath) -> float:
    """What is unreached, but for the thin rim of the layers."""
    return sum(item.volume for item in path.unreached if "so thin over intact metal" not in item.why)


def test_the_beads_fill_what_is_reachable() -> None:
    path = plan_dent()
    assert measure_others(path) < 0.01 * path.deposit_volume
    assert path.fill is not None
    assert path.fill.filled > 0.99
    assert path.fill.spill_distance <= path.width
    assert path.fill.void <= path.heights[0]


def test_layers_are_equal_and_end_at_the_top() -> None:
    path = plan_dent()
    tops = np.unique(np.round(path.points[path.on][:, 2], 6))
    assert np.allclose(np.diff(tops), path.heights[0])
    assert path.heights[0] <= OPTIONS["height"]
    assert tops[-1] == pytest.approx(0, abs=1e-6)
    assert len(tops) == path.layers == 4


def test_length_time_and_volume_are_those_of_the_moves() -> None:
    path = plan_dent()
    steps = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    assert path.length == pytest.approx(steps[path.on[1:]].sum())
    laying = path.on[1:]
    assert path.minutes == pytest.approx((steps[laying] / path.feed[1:][laying]).sum() + path.travel / 3000)
    slower = path.planned_sizes[path.on, 1] / path.sizes[path.on, 1]
    assert path.feed[path.on] == pytest.approx(600 * slower)
    assert path.bead_volume == pytest.approx((steps[laying] / slower).sum() * path.heights[0] * 0.7 * 2.0)
    # the flanks of a bead beside the border are not full
    assert path.bead_volume > 0.9 * path.deposit_volume


@pytest.mark.variants(1)
@pytest.mark.parametrize("pattern", ["contour", "spiral", "offset-zigzag"])
def test_other_patterns_fill_it_too(pattern: str) -> None:
    path = plan(dent(), direction=UP, pattern=pattern)
    assert path.fill is not None
    assert path.fill.filled > 0.985
    assert measure_others(path) < 0.01 * path.deposit_volume


def slot() -> Loss:
    """A deep and short slot with upright walls, open upward and to both sides."""
    block = BLOCK ^ Manifold.cube((60, 6, 60), True)
    return cut(block, Manifold.cube((8, 60, 24)).translate((-4, -30, -12)))


def measure_gap(path: DepositPath, obstacle: Mesh) -> float:
    """The least distance of the nozzle's corners and sides from a mesh over all poses, by other means than the
    planner's: densely placed points on the nozzle, and libigl."""
    nozzle = path.nozzle
    share = np.linspace(0, 1, 12)[:, None]
    edges = np.unique(np.sort(nozzle.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0)
    ends = nozzle.vertices[edges]
    skin = np.concatenate([end[0] + share * (end[1] - end[0]) for end in ends[::6]])
    found = np.inf
    for k in np.flatnonzero(path.on):
        for part in (0.0, 0.5):
            tip = path.points[k] + part * (path.points[k - 1] - path.points[k]) + path.standoff * path.axes[k]
            found = min(found, distance_to_mesh(skin @ turn_to_axis(path.axes[k]).T + tip, obstacle).min())
    return float(found)


@pytest.mark.slow
def test_the_nozzle_keeps_its_clearance() -> None:
    loss = slot()
    rod = {**NOZZLE, "tip_radius": 0.4, "cone_angle": 0.0, "body_radius": 0.4}
    path = plan(loss, direction=UP, clearance=0.5, nozzle=rod)
    assert path.points[path.on].size
    assert path.clearance >= 0.25
    assert measure_gap(path, loss.left) >= path.clearance - 1e-6


@pytest.mark.slow
def test_what_a_fat_nozzle_does_not_reach_is_listed_with_its_volume() -> None:
    loss = slot()
    rod = {**NOZZLE, "tip_radius": 0.4, "cone_angle": 0.0, "body_radius": 0.4}
    thin = plan(loss, direction=UP, clearance=0.3, nozzle=rod)
    fat = plan(loss, direction=UP, nozzle={**NOZZLE, "tip_radius": 5.0})
    assert thin.unreached_volume < 0.01 * loss.lost.volume
    # 12 deep, and the tip 3 above the bead: the floor is too deep for it, and nothing holds what would lie above
    assert fat.unreached_volume == pytest.approx(loss.lost.volume, rel=0.01)
    assert fat.missing is not None
    assert fat.missing.volume == pytest.approx(fat.unreached_volume, rel=1e-6)
    assert any("nozzle" in item.why for item in fat.unreached)
    assert any("not filled" in note for note in fat.notes)


def test_what_hangs_in_the_air_is_not_built() -> None:
    """A plate on one wall, built up along the wall: only what the overhang permits is held."""
    path = plan(corner(), direction=(0.0, 0.0, -1.0))
    assert any("stands on nothing" in item.why for item in path.unreached)
    assert path.unreached_volume > 0.5 * path.deposit_volume


@pytest.mark.slow
def test_the_direction_is_found() -> None:
    found = plan(dent(), simulate=False)
    assert found.directions[0] == pytest.approx(UP, abs=1e-3)
    assert plan(dent(), direction="normal", simulate=False).directions[0] == pytest.approx(UP, abs=1e-3)


@pytest.mark.slow
def test_another_deposit_and_a_fixture_are_kept_clear_of(tmp_path: Any) -> None:
    import trimesh

    loss = cut(BLOCK, Manifold.sphere(10, 64).translate((0, 0, 7)))
    wall = trimesh.creation.box((30, 2, 30), transform=trimesh.transformations.translation_matrix((0, 4, 16)))
    wall.export(tmp_path / "wall.stl")
    held = plan(loss, direction=UP, fixture=tmp_path / "wall.stl", simulate=False)
    solid = Solid(wall.vertices, wall.faces)
    stage = Layers(**OPTIONS, direction=UP, simulate=False)
    beside = stage.run(body=loss.lost, left=loss.left, built=solid, tolerance=TOLERANCE)
    assert beside is not None
    assert held.unreached_volume == pytest.approx(beside.unreached_volume, rel=1e-6)
    assert held.unreached_volume > 0.1 * loss.lost.volume
    assert measure_gap(held, solid) >= held.clearance - 1e-6


@pytest.mark.slow
def test_the_same_twice() -> None:
    loss = cut(BLOCK, Manifold.cube((16, 14, 9)).translate((14, 9, -3)))
    first, second = plan(loss), plan(loss)
    assert first.points.tobytes() == second.points.tobytes()
    assert first.axes.tobytes() == second.axes.tobytes()


@pytest.mark.slow
def test_short_passes_are_left_out_and_listed() -> None:
    path = plan(dent(), direction=UP, min_length=30.0, simulate=False)
    assert any("shortest pass" in item.why for item in path.unreached)
    lengths = np.bincount(path.number[path.on], weights=path.moves[path.on])
    assert lengths[lengths > 0].min() >= 30


def test_overlaps_at_start_and_stop() -> None:
    overlaps = {"start_overlap": 0.4, "stop_overlap": 0.6}
    plain, longer = plan_dent(), plan(dent(), direction=UP, simulate=False, **overlaps)
    assert longer.passes == plain.passes
    assert longer.length == pytest.approx(plain.length + plain.passes * 1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"nozzle": {"tip_radius": 1.0}}, "tip_radius, length and body_radius"),
        ({"nozzle": {**NOZZLE, "mesh": "x.stl"}}, "not both"),
        ({"nozzle": {**NOZZLE, "body_radius": 0.1}}, "smaller than tip_radius"),
        ({"standoff": 0.1}, "smaller than clearance"),
        ({"direction": (0.0, 0.0, 0.0)}, "length above 0"),
    ],
)
def test_options_that_contradict_each_other_are_refused(options: dict[str, Any], text: str) -> None:
    with pytest.raises(ValidationError, match=text):
        Layers(**{**OPTIONS, **options})


def test_sites_named_come_first() -> None:
    stage = Layers(**OPTIONS, sites=(3, 1))
    assert sorted([1, 2, 3, 4], key=lambda number: (stage.rank_site(number), number)) == [3, 1, 2, 4]


@cache
def plan_along(name: str) -> tuple[Loss, DepositPath]:
    loss = {"groove": groove, "bowl": bowl, "tip": tip}[name]()
    return loss, plan(loss, layers="conformal", axes=5, direction=UP)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bowl", pytest.param("groove", marks=pytest.mark.slow), "tip"])
def test_layers_along_the_floor_fill_the_deposit(name: str) -> None:
    loss, path = plan_along(name)
    assert path.unreached_volume < 0.04 * loss.lost.volume
    assert path.fill is not None
    assert path.fill.filled > 0.985
    assert path.fill.spill_distance <= path.width
    assert path.fill.void <= path.heights[0]
    assert path.bead_volume > 0.7 * path.deposit_volume


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tip", "groove", "bowl"])
def test_the_turning_nozzle_keeps_its_clearance(name: str) -> None:
    loss, path = plan_along(name)
    assert np.abs(np.diff(path.axes[path.on], axis=0)).max() > 1e-3
    assert path.clearance >= 0.2
    assert measure_nozzle(path, loss.left, path.width / 10) >= min(path.clearance, path.travel_clearance) - 1e-6


@pytest.mark.slow
def test_the_nozzle_stays_above_the_layer_that_it_lays() -> None:
    """Of a dome, whose middle lies in the way between its sides."""
    loss, path = plan_along("tip")
    own = path.layer == path.layer.max()
    tips = (path.points + path.standoff * path.axes)[own]
    assert measure_depth(tips, loss, path) >= path.layer.max() * path.heights[0] + 0.2


def measure_depth(points: Any, loss: Loss, path: DepositPath) -> float:
    """The least distance of points from the stub of the blade, a cylinder about the y axis."""
    return float(np.linalg.norm(points[:, [0, 2]], axis=1).min() - 26)


def test_a_floor_that_cannot_be_followed_is_refused() -> None:
    with pytest.raises(StageError, match="steps"):
        plan(stair(), layers="conformal", direction=UP)


@pytest.mark.slow
def test_a_nozzle_from_a_mesh(tmp_path: Any) -> None:
    import trimesh

    body = trimesh.creation.cylinder(1.0, 60, transform=trimesh.transformations.translation_matrix((0, 0, 30)))
    body.export(tmp_path / "nozzle.stl")
    loss: Loss = dent()
    path = plan(loss, direction=UP, nozzle={"mesh": tmp_path / "nozzle.stl"}, simulate=False)
    assert measure_others(path) < 0.01 * path.deposit_volume
    assert len(path.nozzle.faces) == len(body.faces)
