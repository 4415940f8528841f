"""Neighbours, thinning and areas against a search through all points."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.geometry.neighbourhoods import (
    find_in_box,
    find_nearby,
    find_neighbours,
    measure_local_areas,
    pick_one_per_cube,
    query_at_few,
    thin_points,
)
from damageest.geometry.sampling import sample_by_area
from tests.geometry.shapes import FAR, torus


@given(st.integers(0, 10_000), st.floats(0, 2), st.sampled_from([0.0, 1e5]))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_all_points_within_reach_are_found_and_none_far_off(seed: int, reach: float, away: float) -> None:
    rng = np.random.default_rng(seed)
    points, places = rng.normal(size=(200, 3)) * 3 + away, rng.normal(size=(40, 3)) + away
    points[:20] += 50 * rng.choice([-1, 1], (20, 3))
    distance = np.linalg.norm(points[:, None] - places, axis=2).min(axis=1)
    index = find_nearby(points, places, reach)
    assert (np.diff(index) > 0).all()
    assert set(np.flatnonzero(distance <= reach).tolist()) <= set(index.tolist())
    assert index.min(initial=20) >= 20


def test_no_points_or_places_have_nothing_near() -> None:
    none, some = np.empty((0, 3)), np.zeros((4, 3))
    assert len(find_nearby(none, some, 1.0)) == len(find_nearby(some, none, 1.0)) == 0


@given(st.integers(0, 10_000))
@settings(max_examples=25, deadline=None)
def test_points_in_a_box(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.integers(-3, 4, (100, 3)).astype(float)
    low, high = np.sort(rng.integers(-3, 4, (2, 3)), axis=0).astype(float)
    expected = ((points > low) & (points < high)).all(axis=1)
    assert np.array_equal(find_in_box(points, low, high), np.flatnonzero(expected))


@given(st.integers(0, 1000), st.floats(0.1, 3))
@settings(max_examples=25, deadline=None)
def test_thinning_keeps_the_mean_and_the_count(seed: int, cell: float) -> None:
    points = np.random.default_rng(seed).normal(size=(200, 3))
    means, counts, first = thin_points(points, cell)
    assert counts.sum() == 200
    assert np.allclose(np.average(means, axis=0, weights=counts), points.mean(axis=0))
    assert (np.linalg.norm(points[first] - means, axis=1) <= np.sqrt(3) * cell).all()


def test_one_point_of_each_cube_is_picked_the_first() -> None:
    points = np.array([[0.1, 0, 0], [0.2, 0, 0], [1.5, 0, 0], [0.0, 0, 0], [1.2, 0, 0], [0, 3, 0]])
    assert pick_one_per_cube(points, 1.0).tolist() == [0, 2, 5]
    assert pick_one_per_cube(points + FAR, 1.0).tolist() == [0, 2, 5]
    assert pick_one_per_cube(points, 0.01).tolist() == [0, 1, 2, 3, 4, 5]


@given(st.integers(0, 10_000), st.integers(1, 8))
@settings(max_examples=25, deadline=None)
def test_neighbours_are_the_nearest_in_order(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points, among = rng.normal(size=(20, 3)), rng.normal(size=(6, 3))
    apart = np.linalg.norm(points[:, None] - among, axis=2)
    distance, index = find_neighbours(points, count, among)
    assert distance.shape == index.shape == (20, min(count, 6))
    assert distance == pytest.approx(np.sort(apart, axis=1)[:, :count])
    assert np.take_along_axis(apart, index, axis=1) == pytest.approx(distance)
    assert np.array_equal(find_neighbours(points, count)[1][:, 0], np.arange(20))
    within, index = find_neighbours(points, count, among, reach=1.0)
    beyond = distance > 1.0
    assert (np.isinf(within) == beyond).all()
    assert ((index == 6) == beyond).all()


def test_the_areas_of_points_add_up_to_the_surface() -> None:
    ring = torus()
    points, _ = sample_by_area(ring, 5000, np.random.default_rng(0))
    area = measure_local_areas(points)
    assert area.sum() == pytest.approx(ring.area, rel=0.1)
    assert measure_local_areas(points + FAR) == pytest.approx(area, rel=1e-6)
    with_outlier = measure_local_areas(np.vstack([points, [[1000.0, 0, 0]]]))
    assert with_outlier[-1] == pytest.approx(4 * np.median(with_outlier))
    assert measure_local_areas(points[:2]).tolist() == [1e-12, 1e-12]


@pytest.mark.parametrize("count", [3000, 150_000])
def test_the_nearest_points_of_a_few_places(count: int) -> None:
    rng = np.random.default_rng(6)
    points = rng.uniform(0, 50, (count, 3)) + FAR
    places = points[:40]
    distance, near = query_at_few(points, places, 8, rng)
    expected, index = find_neighbours(places, 8, points)
    assert np.allclose(distance, expected)
    assert np.allclose(near + places[0], points[index])
