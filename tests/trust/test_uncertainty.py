"""How the errors of sites add up: independent ones as squares, shared ones as they are, hidden metal to one side."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from damageest.trust.interval.site_error import WIDTH, SiteError, combine_site, combine_total, measure_certain
from tests.trust.errors import change, make_error, take

SIZES = st.floats(0.0, 10.0)
ERRORS = st.builds(
    make_error,
    volume=st.floats(100.0, 1000.0),
    noise=SIZES,
    spacing=SIZES,
    rim=SIZES,
    excess=st.floats(-5.0, 5.0),
    pose=st.lists(st.floats(-5.0, 5.0), min_size=3, max_size=3).map(np.array),
    form=SIZES,
    inside=SIZES,
    less=SIZES,
    depth=st.floats(1.0, 20.0),
)
PLAIN = make_error(100.0, noise=1.0, pose=np.zeros(3))


def half_width(errors: list[SiteError]) -> float:
    low, high = combine_total(sum(one.volume for one in errors), errors)
    return (high - low) / 2


@pytest.mark.slow
@given(ERRORS)
def test_interval_holds_the_volume_and_no_negative_one(error: SiteError) -> None:
    (low, high), (shallow, deep) = combine_site(error)
    assert 0 <= low <= error.volume <= high
    assert 0 <= shallow <= deep


@given(st.lists(ERRORS, min_size=1, max_size=5))
def test_total_is_no_wider_than_the_sites_together(errors: list[SiteError]) -> None:
    errors = [change(one, excess=0.0) for one in errors]
    assert half_width(errors) <= sum(half_width([one]) for one in errors) * (1 + 1e-9)


@given(
    ERRORS,
    st.sampled_from(["noise", "spacing", "rim", "form", "tessellation", "inside", "less", "beside", "fading"]),
    SIZES,
)
def test_a_larger_error_never_makes_the_interval_narrower(error: SiteError, name: str, more: float) -> None:
    wider = change(error, **{name: take(error, name) + more})
    low, high = combine_total(error.volume, [error])
    wider_low, wider_high = combine_total(error.volume, [wider])
    assert wider_low <= low + 1e-9
    assert wider_high >= high - 1e-9


@pytest.mark.parametrize("count", [1, 4, 9])
def test_noise_of_alike_sites_adds_as_squares(count: int) -> None:
    assert half_width([PLAIN] * count) == pytest.approx(WIDTH * np.sqrt(count))


@pytest.mark.parametrize("count", [1, 4, 9])
def test_what_sites_share_adds_as_it_is(count: int) -> None:
    shared = change(PLAIN, noise=0.0, form=1.0)
    assert half_width([shared] * count) == pytest.approx(WIDTH * count)
    moved = change(PLAIN, noise=0.0, pose=np.array([1.0, 0.0, 0.0]))
    assert half_width([moved] * count) == pytest.approx(WIDTH * count)


def test_a_shift_of_the_pose_cancels_between_opposite_sites() -> None:
    one = change(PLAIN, noise=0.0, pose=np.array([2.0, 0.0, 0.0]))
    other = change(one, pose=-take(one, "pose"))
    assert half_width([one, other]) == pytest.approx(0.0)


@pytest.mark.parametrize("name", ["inside", "beside", "fading"])
def test_hidden_metal_widens_one_side(name: str) -> None:
    low, high = combine_total(100.0, [change(PLAIN, **{name: 7.0})])
    assert (low, high) == pytest.approx((100 - WIDTH, 100 + WIDTH + 7))


def test_a_mean_error_moves_the_interval() -> None:
    low, high = combine_total(100.0, [change(PLAIN, excess=1.0)])
    assert (low, high) == pytest.approx((99 - WIDTH, 99 + WIDTH))


def test_doubtful_sites_raise_the_high_end() -> None:
    assert combine_total(100.0, [PLAIN], 30.0)[1] == combine_total(100.0, [PLAIN])[1] + 30
    assert combine_total(0.0, [], 30.0) == (0.0, 30.0)


def test_no_site_has_no_error() -> None:
    assert combine_total(0.0, []) == (0.0, 0.0)


@pytest.mark.parametrize("name", ["spacing", "rim", "form"])
def test_what_is_the_same_error_in_each_site_adds_as_it_is(name: str) -> None:
    """Twenty equal sites: the total is as uncertain as twenty times one of them. Noise averages out."""
    site = change(PLAIN, noise=0.0, **{name: 3.0})
    assert half_width([site] * 20) == pytest.approx(20 * half_width([site]))
    assert half_width([PLAIN] * 20) == pytest.approx(20**0.5 * half_width([PLAIN]))


def test_skin_that_may_lie_deeper_takes_no_more_off_than_is_lost_there() -> None:
    """Half of a site is 0.4 deep and half 0.1; the skin may lie 0.2 deeper: the deep half is still lost by 0.2. Of a
    site of one depth, the low end is a fifth where nothing of it is certain."""
    depths = np.repeat([0.1, 0.4], 25)
    site = make_error(25.0, form=10.0, exposed=100.0, depths=depths)
    assert combine_site(site)[0] == pytest.approx((10.0, 45.0))
    assert measure_certain(site) == pytest.approx(7.5)
    even = change(site, depths=np.full(50, 0.25))
    assert combine_site(even)[0][0] == pytest.approx(5.0)
    assert measure_certain(even) == pytest.approx(0.0)
