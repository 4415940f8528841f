"""The words for a smooth displacement are those of the virtual scanner's deformations."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry.sampling import sample_by_area
from damageest.geometry.stiff_modes import name_modes
from damageest.stages.scan.deformation import Deformation, deform
from tests import damaged_box

PART = damaged_box.box()
PLACES = sample_by_area(PART, 3000, np.random.default_rng(0))[0]


@pytest.mark.parametrize(
    ("how", "named"),
    [
        ({"bend": 1.0}, ("bend", "x", "z")),
        ({"twist": -0.5}, ("twist", "x", "")),
        ({"scale": 0.3}, ("scale", "", "")),
        ({"stretch": -0.4}, ("stretch", "x", "")),
        ({"taper": 0.5}, ("taper", "x", "")),
        ({"bend": 0.7, "along": [0, 1, 0], "toward": [1, 0, 0]}, ("bend", "y", "x")),
    ],
)
def test_a_single_mode_is_named_with_its_amount(how: dict[str, float], named: tuple[str, str, str]) -> None:
    moved = deform(PLACES, Deformation.model_validate(how), PART) - PLACES
    modes, left = name_modes(PLACES, moved)
    amount = next(iter(how.values()))
    assert modes[0][:3] == named
    assert modes[0].amount == pytest.approx(amount, rel=0.1)
    assert len(modes) == 1
    assert left < 0.05 * abs(amount)


def test_two_modes_and_what_is_left() -> None:
    how = Deformation(bend=1.0, twist=0.6)
    wave = 0.05 * np.sin(3 * PLACES[:, :1]) * np.array([0.0, 0.0, 1.0])
    modes, left = name_modes(PLACES, deform(PLACES, how, PART) - PLACES + wave)
    assert [(mode.kind, mode.axis) for mode in modes] == [("bend", "x"), ("twist", "x")]
    assert left == pytest.approx(0.05 / np.sqrt(2), rel=0.4)


def test_a_rigid_motion_and_nothing_have_no_modes() -> None:
    turned = PLACES @ np.array([[1, -0.001, 0], [0.001, 1, 0], [0, 0, 1]]) + 5 - PLACES
    for moved in (turned, np.zeros_like(PLACES)):
        modes, left = name_modes(PLACES, moved)
        assert not modes or max(abs(mode.amount) for mode in modes) < 1e-3
        assert left < 1e-3
    assert name_modes(np.zeros((0, 3)), np.zeros((0, 3))) == ([], 0.0)
