"""What else explains a scan: both explanations are told, and both count where both are possible."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from damageest.artefacts import Solid
from damageest.stages.adapt._basis import Basis
from damageest.stages.adapt._body import spread_evenly
from damageest.stages.adapt._choose import Score, Trial
from damageest.stages.adapt._field import Field, Freedom
from damageest.stages.adapt._other import find_other, find_thinned
from damageest.trust.interval.site_error import combine_total
from tests import damaged_box
from tests.stages.adapt.test_smooth import TOLERANCE, adapt
from tests.trust.errors import make_error

BASIS = Basis(np.zeros(3), 20.0, np.ones(3))


def make_trial(both: float, outside: float) -> Trial:
    noise = np.random.default_rng(0).normal(0, 0.01, 40)
    return Trial(Field.zero(BASIS), Freedom(0.03), Score(both + noise, outside + noise))


@pytest.mark.parametrize(
    ("both", "outside", "noise", "found", "is_open"),
    [
        (1.0, 1.0, 2.0, True, False),
        (1.0, 0.5, 2.0, True, True),
        (3.0, 1.0, 2.0, False, False),
        (1.0, 1.0, 1.0, True, True),
    ],
    ids=["only inward", "outward too", "no better", "the chosen one leaves much"],
)
def test_another_field_is_possible_where_metal_stands_out_or_much_is_left(
    both: float, outside: float, noise: float, found: bool, is_open: bool
) -> None:
    chosen, other = make_trial(3.0, 1.0), make_trial(both, outside)
    rival, both_fit = find_other([chosen, other], chosen, noise)
    assert (rival is not None) == found
    assert both_fit == is_open


def test_the_skin_that_another_field_has_deeper_is_measured() -> None:
    box = damaged_box.box()
    skin = Solid(box.vertices - box.bounds.mean(axis=0), box.faces)
    still, thin = Field.zero(BASIS), Field.zero(BASIS).coefficients.copy()
    linear = int(np.argmax(BASIS.differentiate(np.zeros((1, 3)))[0, :, 2]))
    thin[linear, 2] = -0.4 / (10 / BASIS.size)  # both faces across z come in by 0.4 at z = ±10
    found = find_thinned(skin, still, replace(still, coefficients=thin), TOLERANCE)
    assert found.depth == pytest.approx(0.4)
    assert found.area == pytest.approx(2 * 40 * 30)
    assert found.volume == pytest.approx(0.4 * 2 * 40 * 30)


@pytest.mark.slow
def test_wear_that_a_thinner_part_would_look_like_is_told() -> None:
    adapted, _ = adapt("worn", bend=1.0)
    assert adapted is not None
    (told,) = [note for note in adapted.notes if "thinner" in note]
    assert "taken for loss" in told
    assert "datum" in told
    assert adapted.other is None


def test_both_volumes_are_in_the_interval() -> None:
    site = make_error(100.0, noise=1.0, spacing=1.0, rim=1.0, rates=np.array([-60.0]), motions=np.array([[0.0, 1.0]]))
    low, high = combine_total(100.0, [site])
    assert low < 40 < high
    assert high < 110
    whole = make_error(50.0)  # a body that is lost has no rates
    assert combine_total(150.0, [whole, site]) == pytest.approx((low + 50, high + 50))


def test_places_are_spread_evenly() -> None:
    places = spread_evenly(2000)
    assert np.abs(places.mean(axis=0) - 0.5).max() < 0.002
    assert (places.min(axis=0) < 0.01).all()
    assert (places.max(axis=0) > 0.99).all()
