"""The figure of tilts beyond need: none where a wall asks for them, all of them where nothing stands."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from damageest_benchmarks.paths.tilt import RING, measure_beyond_need
from damageest_paths.layers import Layers

from damageest.artefacts import DepositPath, Floats
from tests.path_shapes import OPTIONS, Loss, dent, plan

UP = np.array([0.0, 0.0, 1.0])


@cache
def plan_dent() -> tuple[Loss, DepositPath, Layers]:
    loss = dent()
    options = {"direction": (0.0, 0.0, 1.0), "simulate": False, "axes": 5, "layers": "planar"}
    return loss, plan(loss, **options), Layers(**{**OPTIONS, **options})


def lean(path: DepositPath, degrees: float) -> Floats:
    angle = np.radians(degrees)
    return np.tile(np.sin(angle) * np.array([1.0, 0, 0]) + np.cos(angle) * UP, (len(path.axes), 1))


def test_upright_tools_are_not_tilted_beyond_need() -> None:
    loss, path, stage = plan_dent()
    assert np.allclose(path.axes[path.on], UP)
    assert measure_beyond_need(path, loss.left, stage) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("degrees", [20.0, pytest.param(35.0, marks=pytest.mark.slow)])
def test_all_of_a_tilt_that_nothing_asks_for_is_beyond_need(degrees: float) -> None:
    loss, path, stage = plan_dent()
    found = measure_beyond_need(replace(path, axes=lean(path, degrees)), loss.left, stage)
    assert found.median == pytest.approx(degrees)
    assert found.mean == pytest.approx(degrees, abs=RING)


def test_a_tilt_that_a_wall_asks_for_is_not_beyond_need() -> None:
    """Of a tool that stands in a slot so narrow that it is free nowhere, nothing is."""
    loss, path, stage = plan_dent()
    lower = replace(path, points=path.points - [0, 0, path.standoff + path.width], axes=lean(path, 30.0))
    assert measure_beyond_need(lower, loss.left, stage).median == 0.0
