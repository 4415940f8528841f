"""Far points are told from the part's own, whatever its pose."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry.far_points import find_far

RNG = np.random.default_rng(0)
PART = RNG.uniform(-1, 1, (5000, 3)) * (20, 10, 5)
SIZE = float(np.linalg.norm(np.ptp(PART, axis=0)))


@pytest.mark.parametrize("distance", [4, 1000, 1e9])
def test_far_points_are_found(distance: float) -> None:
    direction = RNG.normal(size=(20, 3))
    far = distance * SIZE * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    found = find_far(np.vstack([PART, far]) + np.array([1e4, 0, -3e3]), SIZE)
    assert found[5000:].all()
    assert not found[:5000].any()


@pytest.mark.parametrize("seed", range(5))
def test_no_point_of_the_part_is_far(seed: int) -> None:
    """Few points, in any pose: the part's own corners and 30 points on it."""
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    points = np.vstack([PART[PART.argmin(0)], PART[PART.argmax(0)], PART[rng.integers(0, 5000, 30)]])
    assert not find_far(points @ turn + 1e3 * rng.normal(size=3), SIZE).any()


def test_what_is_many_or_near_stays() -> None:
    """A table that the part stands on, a second specimen, and a scan of another unit."""
    table = np.column_stack([RNG.uniform(-300, 300, (20_000, 2)), np.full(20_000, -5.0)])
    assert not find_far(np.vstack([PART, table]), SIZE).any()
    assert not find_far(np.vstack([PART, PART[:2000] + 500]), SIZE).any()
    assert not find_far(1000 * PART, SIZE).any()
    assert not find_far(np.empty((0, 3)), SIZE).any()
    assert not find_far(np.ones((50, 3)), SIZE).any()
