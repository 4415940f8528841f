"""Budgets: their sum is what the interval is made of; shared sources add with their sign, own ones as squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.findings import Budget
from damageest.trust.interval.budget import make_depth_budget, make_volume_budget
from damageest.trust.interval.scanner import leave_form, spread_of
from damageest.trust.interval.site_error import WIDTH, Share, SiteError, combine_total
from tests.needs import import_or_skip
from tests.trust.errors import FIGURES, TERMS, change, make_error, take

SIZES = st.floats(0.0, 10.0)
SIGNED = st.floats(-5.0, 5.0)
ERRORS = st.builds(
    make_error,
    volume=st.floats(1000.0, 2000.0),
    noise=SIZES,
    spacing=SIZES,
    rim=SIZES,
    pose=st.lists(SIGNED, min_size=6, max_size=6).map(np.array),
    tessellation=SIZES,
    form=SIZES,
    outward=SIZES,
    views=SIZES,
    adapt=st.lists(SIGNED, min_size=3, max_size=3).map(np.array),
    probing_form=SIZES,
    scanner=st.lists(SIGNED, min_size=2, max_size=2).map(np.array),
    exposed=st.floats(1.0, 100.0),
)
SHARED = ("spacing", "rim", "form", "tessellation", "outward", "views")
PLAIN = make_error(100.0, probing_form=0.0, scanner=np.array([2.0, 0.0]), exposed=10.0)


def make(errors: list[SiteError]) -> Budget:
    budget = make_volume_budget(errors, "mm")
    assert budget is not None
    return budget


@settings(max_examples=50)
@given(st.lists(ERRORS, min_size=1, max_size=4))
def test_the_expanded_uncertainty_is_half_the_interval(errors: list[SiteError]) -> None:
    budget = make(errors)
    low, high = combine_total(sum(one.volume for one in errors), errors)
    assert budget.expanded == pytest.approx((high - low) / 2, rel=1e-9, abs=1e-9)
    assert budget.combined**2 == pytest.approx(sum(row.contribution**2 for row in budget.rows), abs=1e-12)
    if budget.combined:
        assert sum(row.share for row in budget.rows) == pytest.approx(1.0)


def test_two_sites_have_the_uncertainty_of_the_gum_tree_calculator() -> None:
    """Noise and probing form are of each site alone; what is left is one input in both."""
    ureal = import_or_skip("GTC").ureal

    def draw(seed: int) -> SiteError:
        rng = np.random.default_rng(seed)
        one = {name: float(rng.uniform(1, 5)) for name in (*SHARED, "noise", "probing_form")}
        pose, adapt, told = (rng.normal(size=count) for count in (6, 3, 2))
        return make_error(1000.0, pose=pose, adapt=adapt, scanner=told, exposed=10.0, **one)

    sites = [draw(1), draw(2)]
    inputs = {name: ureal(0, 1) for name in (*SHARED, *range(11))}
    total = ureal(0, 1) * 0
    for one in sites:
        total += float(take(one, "noise")[0]) * ureal(0, 1) + float(take(one, "probing_form")[0]) * ureal(0, 1)
        total += sum(float(take(one, name)[0]) * inputs[name] for name in SHARED)
        signed = np.concatenate([take(one, name) for name in ("pose", "adapt", "probing_size", "length")])
        total += sum(float(c) * inputs[k] for k, c in enumerate(signed))
    assert make(sites).combined == pytest.approx(total.u, rel=1e-12)


@settings(max_examples=50)
@given(ERRORS)
def test_uncertainty_times_sensitivity_is_the_contribution(error: SiteError) -> None:
    for row in make([error]).rows:
        assert row.uncertainty * abs(row.sensitivity) == pytest.approx(row.contribution)
        assert row.source in TERMS


def test_an_offset_cancels_between_sites_that_it_moves_against_each_other() -> None:
    other = change(PLAIN, scanner=np.array([-2.0, 0.0]))
    assert make([PLAIN]).combined == pytest.approx(2)
    assert make([PLAIN, PLAIN]).combined == pytest.approx(4)
    assert make([PLAIN, other]).combined == pytest.approx(0)


def test_a_figure_of_the_certificate_has_its_row_though_it_changes_nothing() -> None:
    rows = {row.source: row for row in make([change(PLAIN, scanner=np.zeros(2))]).rows}
    assert {"probing_size", "length", "probing_form"} <= set(rows)
    assert rows["length"].distribution == "rectangular"


def test_what_moves_one_end_is_a_bound_and_no_row() -> None:
    budget = make([change(PLAIN, inside=7.0, less=3.0)])
    assert {(one.source, one.low, one.high) for one in budget.bounds} == {("inside", 0.0, 7.0), ("closed", -3.0, 0.0)}
    assert budget.combined == pytest.approx(2)


def test_the_budget_of_the_depth_has_its_error() -> None:
    by = {"noise": 0.03, "spacing": 0.04, "pose": 0.0, "probing_size": -0.12}
    shares = tuple((TERMS[name], Share(0.0, depth, figure=FIGURES.get(name))) for name, depth in by.items())
    error = replace(PLAIN, depth=5.0, shares=shares)
    assert error.depth_error == pytest.approx(0.13)
    budget = make_depth_budget(error, "mm")
    assert budget is not None
    assert budget.combined == pytest.approx(error.depth_error)
    assert [row.sensitivity for row in budget.rows if row.source == "probing_size"] == pytest.approx([-12.0])


def test_no_measured_site_no_budget() -> None:
    assert make_volume_budget([], "mm") is None
    assert make_depth_budget(SiteError(5.0), "mm") is None


def test_limits_are_rectangular_and_expanded_uncertainties_normal() -> None:
    assert spread_of(0.02, 2.0) == (0.01, "normal")
    assert spread_of(0.03, None) == (pytest.approx(0.03 / WIDTH * 2 / 3**0.5), "rectangular")


def test_a_probing_form_error_that_the_noise_explains_counts_once() -> None:
    assert leave_form(0.08, 0.02, 0.0) == 0
    assert leave_form(0.08, 0.0, 0.0) == pytest.approx(0.02)
    assert leave_form(0.1, 0.015, 0.02) == pytest.approx(0, abs=1e-6)
