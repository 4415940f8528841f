"""Deformed parts of the virtual scanner."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

from damageest.geometry.transforms import remove_rigid
from damageest.stages.scan.deformation import Deformation, deform
from damageest.stages.scan.simulate import Simulate
from tests.damaged_box import box

PART = box()
POINTS = Simulate.model_validate({"points": 4000, "noise": 0}).run("mm", PART).points


def measure(moved: np.ndarray) -> float:
    return float(np.linalg.norm(remove_rigid(POINTS, moved - POINTS, np.ones(len(POINTS))), axis=1).max())


@pytest.mark.parametrize(
    "how",
    [
        {"bend": 0.4},
        {"twist": 0.4},
        {"bend": -0.4, "along": [0, 1, 0], "toward": [1, 0, 0]},
        {"scale": 0.4},
        {"scale": -0.4},
        {"stretch": 0.4},
        {"taper": 0.4},
        {"free": 0.4, "seed": 3},
    ],
)
def test_the_amount_is_the_largest_displacement_beyond_a_rigid_motion(how: dict[str, object]) -> None:
    assert measure(deform(POINTS, Deformation.model_validate(how), PART)) == pytest.approx(0.4, rel=0.05)


def test_an_arc_keeps_lengths_along_its_axis() -> None:
    centre = PART.bounds.mean(axis=0)
    line = centre + np.linspace(-20, 20, 400)[:, None] * [1.0, 0, 0]
    bent = deform(line, Deformation(bend=3.0), PART)
    assert np.linalg.norm(np.diff(bent, axis=0), axis=1).sum() == pytest.approx(40, rel=1e-4)
    assert np.ptp(bent[:, 2]) > 1


def test_a_scan_is_deformed_and_its_truth_is_not() -> None:
    options = {"points": 4000, "noise": 0, "deform": {"twist": 0.5}, "seed": 3}
    scan = Simulate.model_validate(options).run("mm", PART)
    plain = Simulate.model_validate({**options, "deform": None}).run("mm", PART)
    assert np.linalg.norm(scan.points - plain.points, axis=1).max() == pytest.approx(0.5, rel=0.1)
    assert scan.truth is not None
    assert scan.truth.damage is None


def test_the_truth_in_the_deformed_part_is_deformed_with_it() -> None:
    sphere = {"tool": "sphere", "centre": [15, 0, 10], "radius": 4}
    options = {"points": 4000, "noise": 0, "damage": [sphere], "deform": {"scale": 2.0}}
    truth = Simulate.model_validate(options).run("mm", PART).truth
    assert truth is not None
    assert truth.damage is not None
    assert truth.deformed is not None
    share = 1 + 2.0 / (PART.diagonal / 2)
    assert truth.deformed.volume == pytest.approx(share**3 * truth.damage.volume, rel=0.01)
    plain = Simulate.model_validate({**options, "deform": None}).run("mm", PART).truth
    assert plain is not None
    assert plain.deformed is None


def test_a_free_form_is_another_for_another_seed() -> None:
    one, same, other = (deform(POINTS, Deformation(free=0.4, seed=seed), PART) for seed in (1, 1, 2))
    assert np.array_equal(one, same)
    assert np.abs(one - other).max() > 0.1


def test_surroundings_are_not_deformed_with_the_part() -> None:
    with pytest.raises(ValidationError, match="surroundings"):
        Simulate.model_validate({"deform": {"bend": 1}, "table": {}})
