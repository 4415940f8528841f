"""A displacement field: polynomials are met exactly, its gradient is that of its motion, bad lattices are named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import ArtefactError, DisplacementField, Floats, fit_displacement

LOW, HIGH = np.array([-3.0, 0.0, 10.0]), np.array([4.0, 0.5, 60.0])


def place(seed: int, count: int = 40) -> Floats:
    """Places in the box, and a little beside it."""
    return np.asarray(LOW + (HIGH - LOW) * np.random.default_rng(seed).uniform(-0.1, 1.1, (count, 3)))


def make_cubic(seed: int) -> Any:
    factors = np.random.default_rng(seed).normal(size=(4, 3)) * 0.1

    def displace(at: Floats) -> Floats:
        q = (at - LOW) / (HIGH - LOW)
        return np.asarray(factors[0] + q @ factors[1:] + (q**3)[:, [1, 2, 0]] * factors[1] - q**2 * factors[2])

    return displace


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 999), st.tuples(*[st.integers(0, 3)] * 3))
def test_a_cubic_polynomial_is_met_exactly_whatever_the_cells(seed: int, cells: tuple[int, int, int]) -> None:
    displace, at = make_cubic(seed), place(seed)
    field = fit_displacement(displace, LOW, HIGH, cells)
    assert field.cells == tuple(max(1, count) for count in cells)
    assert np.abs(field.displace(at) - displace(at)).max() < 1e-10
    assert np.array_equal(field.move(at), at + field.displace(at))
    step = np.eye(3)[0] * 1e-4
    slope = (field.move(at + step) - field.move(at - step)) / 2e-4
    assert np.abs(field.differentiate(at)[:, :, 0] - slope).max() < 1e-6


def test_what_no_polynomial_holds_is_met_better_by_more_cells() -> None:
    def wave(at: Floats) -> Floats:
        return np.sin(at[:, :1] * [2.0, 1.0, 0.5])

    at = np.clip(place(1), LOW, HIGH)
    fields = [fit_displacement(wave, LOW, HIGH, (n, 1, 1)) for n in (1, 4, 12)]
    off = [np.abs(field.displace(at) - wave(at)).max() for field in fields]
    assert off[2] < 0.1 * off[1] < 0.1 * off[0]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"controls": np.zeros((4, 4, 3, 3))}, "fewer than 4 along an axis"),
        ({"controls": np.zeros((4, 4, 4))}, "controls: expected"),
        ({"low": HIGH}, "not above low"),
        ({"low": np.array([0.0, np.nan, 0.0])}, "not finite"),
    ],
)
def test_a_bad_lattice_is_named(change: dict[str, Any], text: str) -> None:
    with pytest.raises(ArtefactError, match=text):
        DisplacementField(**({"low": LOW, "high": HIGH, "controls": np.zeros((4, 4, 4, 3))} | change))
