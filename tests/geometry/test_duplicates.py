"""Equal points are found, and only equal ones."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from damageest.geometry.duplicates import (
    find_duplicates,
    find_members,
    group_integers,
    list_distinct,
    list_used,
    order_integers,
)


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


def find_collision(first: np.ndarray, x: float) -> np.ndarray:
    """A point with the given x whose hash is that of another: each step of the hash can be undone."""
    odd, mask = (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F), 2**64 - 1

    def mix(a: int, b: int) -> int:
        state = 0
        for column, factor in zip((a, b), odd, strict=True):
            state = ((state ^ (column >> 29) ^ column) * factor) & mask
            state ^= state >> 32
        return state

    a, b, c = (int(bits) for bits in first.view(np.uint64))
    other = int(np.float64(x).view(np.uint64))
    wanted = c ^ (c >> 29) ^ mix(a, b) ^ mix(other, b)
    return np.array([other, b, wanted ^ (wanted >> 29) ^ (wanted >> 58)], np.uint64).view(np.float64)


def test_points_with_equal_hashes_are_compared_in_full() -> None:
    first = np.array([1.0, 2.0, 3.0])
    other = next(point for x in range(2, 50) if np.isfinite(point := find_collision(first, float(x))).all())
    keep, inverse = find_duplicates(np.stack([first, other, first, other, other]))
    assert keep.tolist() == [0, 1]
    assert inverse.tolist() == [0, 1, 0, 1, 1]


@given(st.lists(st.integers(-5, 5)), st.lists(st.integers(-5, 5)))
def test_sorting_finds_what_numpy_finds(one: list[int], two: list[int]) -> None:
    values, others = np.array(one, np.int64), np.array(two, np.int64)
    assert np.array_equal(list_distinct(values), np.unique(values))
    assert np.array_equal(find_members(values, others), np.isin(values, others))


def test_vertices_that_no_face_uses_are_left_out() -> None:
    assert list_used(np.array([[4, 1, 7], [1, 7, 2]])).tolist() == [1, 2, 4, 7]


@given(arrays(np.int64, st.integers(0, 60), elements=st.one_of(st.integers(-5, 5), st.integers(-(2**60), 2**60))))
def test_groups_are_those_that_numpy_finds(values: NDArray[np.int64]) -> None:
    """Also where differences are too large to sort a number together with its place."""
    first, group, count = group_integers(values)
    _, *expected = np.unique(values, return_index=True, return_inverse=True, return_counts=True)
    for found, right in zip((first, group, count), expected, strict=True):
        assert np.array_equal(found, right)
    assert np.array_equal(order_integers(values), np.argsort(values, kind="stable"))
