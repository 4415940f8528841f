"""Planes or layers along the floor: what loses less of the deposit is taken, and said."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from damageest_benchmarks.paths.check import measure_nozzle
from damageest_paths import assemble, form_choice
from damageest_paths.drafts import MUCH_SUNK
from damageest_paths.form_choice import MOST_LEFT, PLANNERS, POOR, count_planes, is_thin_shell, measure_lost
from damageest_paths.process.process import Pass
from damageest_paths.travel.moves import Moves, join_passes
from manifold3d import CrossSection, Manifold
from path_cavities import pocket, stair

from damageest.artefacts import DepositPath
from tests.path_shapes import BLOCK, Loss, cut, dent, plan

UP = (0.0, 0.0, 1.0)


@pytest.fixture
def joined(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The number of groups of each sequence of passes between which moves are planned."""
    found: list[int] = []

    def join(groups: Sequence[Sequence[Pass]], *rest: Any) -> Moves:
        found.append(len(groups))
        return join_passes(groups, *rest)

    monkeypatch.setattr(assemble, "join_passes", join)
    return found


def plan_all(loss: Loss, height: float = 1.0) -> dict[str, DepositPath]:
    return {form: plan(loss, direction=UP, axes=5, layers=form, height=height) for form in ("auto", "planar")}


@pytest.mark.slow
def test_where_planes_lose_much_layers_follow_the_floor(joined: list[int]) -> None:
    loss = dent()
    paths = plan_all(loss, 1.3)
    assert len(joined) == len(paths), "moves are planned for the form that is taken alone"
    assert measure_lost(paths["planar"]) > POOR
    assert paths["auto"].layer_form == "conformal"
    assert measure_lost(paths["auto"]) < measure_lost(paths["planar"]) / 2
    assert measure_nozzle(paths["auto"], loss.left, 0.2) > 0


def worn_shaft() -> Loss:
    """A shaft, worn to one side by less than a millimetre."""
    shaft = Manifold.cylinder(6, 6, 6, 96)
    return cut(shaft, shaft - Manifold.cylinder(6, 6, 6, 96).translate((-0.8, 0, 0)))


@pytest.mark.slow
def test_planes_are_not_planned_of_a_thin_shell_that_layers_along_its_floor_fill(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(PLANNERS, "planar", None)
    loss = worn_shaft()
    assert is_thin_shell(loss.lost, 0.4)
    path = plan(loss, axes=5, layers="auto", height=0.4, width=0.8, standoff=2.0)
    assert path.layer_form == "conformal"
    assert measure_lost(path) < POOR
    assert any("in planes at least" in note for note in path.notes)


@pytest.mark.parametrize(("height", "count"), [(1.0, 4), (0.8, 5), (3.0, 2)])
def test_planes_are_counted_across_the_least_extent(height: float, count: int) -> None:
    from damageest.geometry.solids import to_solid

    plate = to_solid(Manifold.cube((20, 14, 4)).rotate((20, 30, 40)))
    assert plate is not None
    assert count <= count_planes(plate, height) <= count + 1


def test_planes_of_two_pieces_are_counted_in_a_direction_each() -> None:
    from damageest.geometry.solids import to_solid

    plate = Manifold.cube((20, 14, 2), True)
    both = to_solid(plate + plate.rotate((90, 0, 0)).translate((0, 30, 0)))
    assert both is not None
    assert 4 <= count_planes(both, 1.0) <= 6


@pytest.mark.slow
def test_on_a_flat_floor_layers_are_planes() -> None:
    paths = plan_all(pocket())
    assert paths["auto"].layer_form == "planar"
    assert np.array_equal(paths["auto"].points, paths["planar"].points)


@pytest.mark.slow
def test_what_no_layer_would_reach_asks_for_no_other_layers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A nozzle for which the lower half is out of reach: the trial, which would take long, is not made."""
    monkeypatch.setitem(PLANNERS, "conformal", None)
    fat = {"tip_radius": 5.0, "cone_angle": 25.0, "length": 60.0, "body_radius": 12.0}
    path = plan(stair(), direction=UP, layers="auto", nozzle=fat)
    assert measure_lost(path) > POOR
    assert path.layer_form == "planar"
    assert len(path.points)


@pytest.mark.slow
def test_the_form_is_that_which_is_asked_for() -> None:
    assert plan(dent(), direction=UP, layers="planar", simulate=False).layer_form == "planar"
    assert plan(pocket(), direction=UP, layers="conformal", simulate=False).layer_form == "conformal"


def notch(half: float, deep: float) -> Loss:
    """A groove with leaning walls and a sharp bottom: beads in planes lie partly in its walls."""
    tool = CrossSection([[(-1.4 * half, 0.4 * deep), (0.0, -deep), (1.4 * half, 0.4 * deep)]]).extrude(12)
    return cut(BLOCK, tool.translate((0, 0, -6)).rotate((90, 0, 0)))


def sunk(path: DepositPath) -> float:
    assert path.fill is not None
    return path.fill.sunk / path.deposit_volume


def test_where_many_beads_lie_in_metal_they_lie_less_deep() -> None:
    usual, given = (plan(notch(2.9, 2.9), direction=UP, axes=5, **more) for more in ({}, {"penetration": 0.45}))
    assert sunk(given) > MUCH_SUNK, "what the job says is done"
    assert sunk(usual) <= MUCH_SUNK
    assert (usual.unreached_volume - given.unreached_volume) / given.deposit_volume < MOST_LEFT


def test_metal_is_not_spared_where_much_would_be_left_unfilled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(form_choice, "MOST_LEFT", 0.0)
    path = plan(notch(3.0, 3.0), direction=UP, axes=5)
    assert sunk(path) > MUCH_SUNK
    assert any("of intact metal" in note for note in path.notes), "it is said"


@pytest.mark.slow
def test_a_place_for_the_starts_of_rings_fails_on_no_form() -> None:
    """On layers that follow the floor it has no direction: they are planned as if aligned."""
    given, aligned = (
        plan(dent(), direction=UP, layers="conformal", axes=5, simulate=False, pattern="contour", starts=one)
        for one in ({"at": [5.0, 0.0, 0.0]}, "aligned")
    )
    assert np.array_equal(given.points, aligned.points)
