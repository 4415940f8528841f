"""Neighbours on both skins of a thin wall are told apart; those on one surface are not parted."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from damageest.geometry.neighbourhoods import make_tree
from damageest.geometry.noise import measure_noise_and_spacing, measure_quiet_noise
from damageest.geometry.sheets import find_own_sheet, query_own_sheet

NOISE = 0.02


def scan_wall(thick: float, spacing: float, noise: float = NOISE, radius: float = 0.0) -> np.ndarray:
    """Points (N,3) on both skins of a wall, flat or bent about the y axis."""
    rng = np.random.default_rng(0)
    count = int((60 / spacing) ** 2)
    places = [np.c_[rng.uniform(0, 60, (count, 2)), rng.normal(z, noise, count)] for z in (0, thick)]
    points = np.concatenate(places)
    if radius:
        angle, far = points[:, 0] / radius, radius + points[:, 2]
        points = np.c_[far * np.sin(angle), points[:, 1], far * np.cos(angle)]
    return points


@cache
def measure_thick_wall(spacing: float) -> tuple[float, float]:
    return measure_noise_and_spacing(scan_wall(30.0, spacing))


@pytest.mark.variants(1)
@pytest.mark.parametrize("radius", [0.0, 25.0])
@pytest.mark.parametrize(("thick", "spacing"), [(4.8, 3.0), (2.0, 1.5), (1.5, 1.0)])
def test_noise_and_spacing_are_those_of_one_skin(thick: float, spacing: float, radius: float) -> None:
    noise, gap = measure_noise_and_spacing(scan_wall(thick, spacing, radius=radius))
    assert gap == pytest.approx(measure_thick_wall(spacing)[1], rel=0.1)
    assert noise == pytest.approx(NOISE, rel=0.25) or (radius and noise < 3 * NOISE)
    assert measure_quiet_noise(scan_wall(thick, spacing)) == pytest.approx(NOISE, rel=0.25)


@pytest.mark.parametrize("count", [16, 64])
def test_neighbours_lie_on_the_skin_of_the_place(count: int) -> None:
    points = scan_wall(2.0, 1.0)
    own = points[:, 2] > 1
    chosen = np.flatnonzero(((points[:, :2] > 10) & (points[:, :2] < 50)).all(axis=1))[::7]
    distance, index = query_own_sheet(make_tree(points), points[chosen], points, count)
    right = own[index] == own[chosen][:, None]
    assert right.all(axis=1).mean() > 0.97
    assert index.shape == distance.shape == (len(chosen), count)
    assert (np.diff(distance, axis=1) >= 0).all()


def make_patches(heights: np.ndarray) -> np.ndarray:
    """Neighbours (N,K,3) of places, which come first, with ``heights`` (N,K) over a plane."""
    place = np.random.default_rng(1).uniform(-1, 1, (*heights.shape, 2))
    patches = np.concatenate([place, heights[..., None]], axis=2)
    return np.asarray(patches - patches[:, :1])


@pytest.mark.parametrize("kind", ["noise", "steps", "edge"])
def test_one_surface_is_not_parted(kind: str) -> None:
    rng = np.random.default_rng(2)
    heights = rng.normal(0, 0.02, (500, 20))
    if kind == "steps":
        heights = np.round(rng.normal(0, 0.05, (500, 20)), 1)
    patches = make_patches(heights)
    if kind == "edge":
        patches[:, :, 2] += np.minimum(patches[:, :, 0], 0)
    assert find_own_sheet(patches).all(axis=1).mean() > 0.97


def test_a_place_off_the_surface_is_on_no_sheet_of_its_own() -> None:
    heights = np.random.default_rng(1).normal(0, 0.02, (50, 20))
    heights[:, 0] = 2.0
    assert find_own_sheet(make_patches(heights)).all()
    heights[:, [0, 7]] = 0.0, 2.0
    assert (~find_own_sheet(make_patches(heights))).sum(axis=0).nonzero()[0].tolist() == [7]
