"""Equal points are found, and only equal ones."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.geometry.duplicates import find_duplicates


@given(st.integers(0, 10_000), st.integers(0, 60), st.integers(1, 4), st.sampled_from([0.0, 1e5, 1e-300]))
@settings(max_examples=60, deadline=None)
def test_the_inverse_gives_the_points_back(seed: int, count: int, values: int, offset: float) -> None:
    points = np.random.default_rng(seed).integers(-values, values, (count, 3)) * 0.1 + offset
    keep, inverse = find_duplicates(points)
    assert np.array_equal(points[keep][inverse], points)
    assert (np.diff(keep) > 0).all()
    assert len(keep) == len(np.unique(points, axis=0))
    # the first copy is kept
    assert all((points[:index] != points[index]).any(axis=1).all() for index in keep)


def test_neighbouring_numbers_differ_and_the_zeros_are_equal() -> None:
    points = np.array([[1.0, 2, 0.0], [1, 2, -0.0], [np.nextafter(1, 2), 2, 0], [2, 1, 0]])
    keep, inverse = find_duplicates(points)
    assert keep.tolist() == [0, 2, 3]
    assert inverse.tolist() == [0, 0, 1, 2]
