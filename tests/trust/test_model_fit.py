"""The model fit names what was done to a part, with its amount, and nothing where nothing was done."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.stages.scan.deformation import Deformation, deform
from tests.trust.form_scenes import TOLERANCE, add_noise, draw_skin, fit, get_part


def test_a_part_as_designed_is_ok() -> None:
    found = fit(add_noise(draw_skin()[0]))
    assert found.fit.model == "ok"
    assert found.form is None
    assert found.fit.deformation == ()
    assert abs(found.fit.scale - 1) < 5e-4
    assert found.fit.waviness < 0.1 * TOLERANCE
    assert [one.size for one in found.fit.deviations] == pytest.approx([4.0, 10.0, 20.0])
    assert not found.predict(*draw_skin(count=10)).any()


@pytest.mark.variants(1)
@pytest.mark.parametrize("scale", [0.998, 1.02])
def test_a_scale_is_named_with_its_size(scale: float) -> None:
    points, _ = draw_skin()
    centre = get_part().bounds.mean(axis=0)
    found = fit(add_noise(centre + scale * (points - centre)))
    assert found.fit.model == "scaled"
    assert found.fit.scale == pytest.approx(scale, abs=5e-4)
    assert "scale" in found.fit.words


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    ("how", "amount"), [("bend", 0.3), pytest.param("bend", 1.5, marks=pytest.mark.slow), ("twist", 0.3)]
)
def test_a_deformation_is_named_with_its_amount(how: str, amount: float) -> None:
    found = fit(add_noise(deform(draw_skin()[0], Deformation.model_validate({how: amount}), get_part())))
    assert found.fit.model == "deformed"
    assert found.fit.deformation[0][0] == how
    assert found.fit.deformation[0][1] == pytest.approx(amount, rel=0.2)
    assert found.fit.amount == pytest.approx(amount, rel=0.2)
    assert found.fit.deviations[0].left < found.fit.deviations[0].deviation


@pytest.mark.slow
def test_the_form_predicts_where_intact_skin_lies() -> None:
    points, normals = draw_skin(count=3000)
    how = Deformation(bend=0.8)
    found = fit(add_noise(deform(draw_skin()[0], how, get_part())), shift=0.0)
    true = np.einsum("ij,ij->i", deform(points, how, get_part()) - points, normals)
    assert np.abs(found.predict(points, normals) - true).max() < 0.3 * TOLERANCE


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", ["one face", "two faces", "all over"])
def test_wear_is_no_form(name: str) -> None:
    points, normals = draw_skin()
    worn = {"one face": normals[:, 2] > 0.9, "two faces": np.abs(normals[:, 2]) > 0.9, "all over": normals[:, 0] < 2}
    found = fit(add_noise(points - 2 * TOLERANCE * normals * worn[name][:, None]))
    assert found.fit.model == "ok"
    assert found.form is None


def test_a_broken_end_is_no_form() -> None:
    points, _ = draw_skin("block")
    low, high = get_part("block").bounds
    end = np.maximum(points[:, 0], low[0] + 0.05 * (high - low)[0])
    assert fit(add_noise(np.column_stack([end, points[:, 1:]])), "block").fit.model == "ok"


@pytest.mark.slow
def test_waves_are_named() -> None:
    points, normals = draw_skin()
    height = 0.25 * np.sin(points[:, 0] / 2.5) * np.cos(points[:, 1] / 2.5)
    found = fit(add_noise(points + height[:, None] * normals))
    assert found.fit.model == "wavy"
    assert 0.05 < found.fit.waviness < 0.25
    assert "wavy" in found.fit.words
