"""Stage `adapt: smooth`: deformed parts are followed; wear and loss are not."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.artefacts import AdaptedPart, Floats, Scan
from damageest.errors import StageError
from damageest.geometry.distance import signed_distance
from damageest.stages.adapt._basis import Basis
from damageest.stages.adapt._field import Field
from damageest.stages.adapt._mesh import require_injective
from damageest.stages.adapt.smooth import Smooth
from damageest.stages.scan.simulate import Simulate
from tests import damaged_box

TOLERANCE = 0.2
NOISE = 0.05
PART = damaged_box.box()
SPHERE = {"tool": "sphere", "centre": [8, 4, 10], "radius": 5}
WORN = {"tool": "plane", "point": [0, 0, 10 - 2 * TOLERANCE], "normal": [0, 0, 1]}


def scan(damage: Any = (), **deform: float) -> Scan:
    options = {"damage": list(damage), "points": 5000, "noise": NOISE, "seed": 2, "deform": deform or None}
    found = Simulate.model_validate(options).run("mm", PART)
    return Scan(found.points, truth=found.truth, noise=NOISE, spacing=0.7)


@lru_cache
def adapt(damage: str = "", **deform: float) -> tuple[AdaptedPart | None, Floats]:
    """The adapted part, and the distances of the scan's points to it."""
    given = scan({"": [], "sphere": [SPHERE], "worn": [WORN]}[damage], **deform)
    adapted = Smooth(points=1500, lattice=()).run(PART, given, TOLERANCE)
    if adapted is None:
        return None, signed_distance(given.points, PART)[0]
    return adapted, signed_distance(given.move(adapted.motion).points, adapted.part)[0]


@pytest.mark.slow
@pytest.mark.parametrize("damage", ["sphere", "worn", pytest.param("", marks=pytest.mark.slow)])
def test_a_part_as_designed_is_not_deformed(damage: str) -> None:
    assert adapt(damage)[0] is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "deform", [{"bend": 1.0}, *(pytest.param({how: 0.6}, marks=pytest.mark.slow) for how in ("stretch", "scale"))]
)
def test_a_deformed_part_is_followed_and_its_loss_stays(deform: dict[str, float]) -> None:
    adapted, distance = adapt("sphere", **deform)
    assert adapted is not None
    assert adapted.gain > 0.2
    deep = distance < -3 * TOLERANCE
    assert np.median(np.abs(distance[~deep])) < 0.8 * NOISE
    assert -distance.min() == pytest.approx(5.0, abs=2 * TOLERANCE)
    amount = next(iter(deform.values()))
    assert 0.5 * amount < adapted.amount < 1.5 * amount


@pytest.mark.slow
def test_wear_of_a_face_stays_on_a_bent_part() -> None:
    adapted, distance = adapt("worn", bend=1.0)
    assert adapted is not None
    worn = distance < -TOLERANCE
    share = 40 * 30 / PART.area
    assert worn.mean() == pytest.approx(share, abs=0.2 * share)
    assert np.median(distance[worn]) == pytest.approx(-2 * TOLERANCE, abs=0.3 * TOLERANCE)


@pytest.mark.slow
def test_the_field_has_no_rigid_part_over_the_seen_skin() -> None:
    adapted, _ = adapt("sphere", bend=1.0)
    assert adapted is not None
    before = adapted.part.vertices - adapted.displacement
    turn = np.cross(before - before.mean(axis=0), adapted.displacement).mean(axis=0)
    assert np.abs(turn).max() < 0.05 * PART.diagonal * adapted.amount


@pytest.mark.slow
def test_its_field_says_where_each_place_went() -> None:
    adapted, _ = adapt("sphere", bend=1.0)
    assert adapted is not None
    assert adapted.field is not None
    before = adapted.part.vertices - adapted.displacement
    assert np.abs(adapted.field.displace(before) - adapted.displacement).max() < 0.1 * TOLERANCE


@pytest.mark.slow
def test_what_is_not_seen_is_known_less_exactly() -> None:
    whole = scan([SPHERE], bend=1.0)
    half = whole.take(whole.points[:, 0] < 4)
    seen, _ = adapt("sphere", bend=1.0)
    cut = Smooth(points=1500, lattice=()).run(PART, half, TOLERANCE)
    assert seen is not None
    assert cut is not None

    def spread(adapted: AdaptedPart) -> float:
        tip = adapted.part.vertices[:, 0] - adapted.displacement[:, 0] > 19
        return float(np.sqrt((adapted.modes[:, tip] ** 2).sum(axis=(0, 2)).mean()))

    assert spread(cut) > 4 * spread(seen)


def test_a_field_that_folds_is_refused() -> None:
    basis = Basis(np.zeros(3), 1.0, np.ones(3))
    field = Field(basis, np.zeros((basis.count, 3)))
    places = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    require_injective(field, np.eye(3), places, 0.0)
    folded = field.coefficients.copy()
    folded[np.argmax(basis.differentiate(np.zeros((1, 3)))[0, :, 0]), 0] = -1.5
    with pytest.raises(StageError, match="fold"):
        require_injective(Field(basis, folded), np.eye(3), places, 1.5)


@pytest.mark.parametrize("cells", [0, 3])
def test_derivatives_are_those_of_the_functions(cells: int) -> None:
    basis = Basis(np.array([1.0, 2, 3]), 5.0, np.array([1.0, 0.6, 0.4]), cells)
    at = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 3)) + basis.centre
    step = 1e-4
    for axis in range(3):
        d = step * np.eye(3)[axis]
        slope = (basis.evaluate(at + d) - basis.evaluate(at - d)) / (2 * step)
        assert np.allclose(slope, basis.differentiate(at)[:, :, axis], atol=1e-6)
        second = (basis.differentiate(at + d) - basis.differentiate(at - d))[:, :, axis] / (2 * step)
        assert np.allclose(second, basis.bound_curvature(at)[:, :, axis], atol=1e-5)


@pytest.mark.slow
def test_a_bent_part_in_a_job(tmp_path: Path) -> None:
    given = scan([SPHERE], bend=1.0)
    job = {"version": 1, "units": "mm", "tolerance": TOLERANCE, "align": "none", "report": "none", "export": "files"}
    result = damageest.run(job, part=PART, scan=given, settings=["adapt=smooth"], output=tmp_path / "out")
    assert result.truth is not None
    assert result.truth[1] > 0.95
    (site,) = result.sites
    assert site.verdict.level != "doubtful"
    assert site.volume_95 is not None
    assert site.volume_95[0] <= result.truth[0] <= site.volume_95[1]
    assert site.uncertainty is not None
    assert site.uncertainty.adapt > 0
    content = json.loads((tmp_path / "out/result.json").read_text())
    assert content["adapt"]["amount"] == pytest.approx(1.0, rel=0.5)
