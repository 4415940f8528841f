"""Planes or layers along the floor: what loses less of the deposit is taken, and said."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_evaluate.paths.check import measure_nozzle
from damageest_paths.form_choice import PLANNERS, POOR, measure_lost
from path_cavities import pocket, stair

from damageest.artefacts import DepositPath
from tests.path_shapes import Loss, dent, plan

UP = (0.0, 0.0, 1.0)


def plan_all(loss: Loss) -> dict[str, DepositPath]:
    return {form: plan(loss, direction=UP, axes=5, layers=form) for form in ("auto", "planar")}


def test_where_planes_lose_much_layers_follow_the_floor() -> None:
    loss = dent()
    paths = plan_all(loss)
    assert measure_lost(paths["planar"]) > POOR
    assert paths["auto"].layer_form == "conformal"
    assert measure_lost(paths["auto"]) < measure_lost(paths["planar"]) / 2
    assert measure_nozzle(paths["auto"], loss.left, 0.2) > 0


def test_on_a_flat_floor_layers_are_planes() -> None:
    paths = plan_all(pocket())
    assert paths["auto"].layer_form == "planar"
    assert np.array_equal(paths["auto"].points, paths["planar"].points)


def test_what_no_layer_would_reach_asks_for_no_other_layers(monkeypatch: pytest.MonkeyPatch) -> None:
    """A nozzle for which the lower half is out of reach: the trial, which would take long, is not made."""
    monkeypatch.setitem(PLANNERS, "conformal", None)
    fat = {"tip_radius": 5.0, "cone_angle": 25.0, "length": 60.0, "body_radius": 12.0}
    path = plan(stair(), direction=UP, layers="auto", nozzle=fat)
    assert measure_lost(path) > POOR
    assert path.layer_form == "planar"
    assert len(path.points)


def test_the_form_is_that_which_is_asked_for() -> None:
    assert plan(dent(), direction=UP, layers="planar").layer_form == "planar"
    assert plan(pocket(), direction=UP, layers="conformal", simulate=False).layer_form == "conformal"
