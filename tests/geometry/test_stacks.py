"""Points that were measured again at the same place are found, and points that only lie close are left as they are."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.stacks import find_stacks
from damageest.io.scans import make_scan

NOISE = 0.03


def draw_skin(rng: np.random.Generator, in_rows: bool) -> Floats:
    """Places on a bent sheet of 40 x 40, about 0.8 apart, at random or in rows."""
    if in_rows:
        u, v = np.meshgrid(np.arange(0, 40, 0.8), np.arange(0, 40, 0.8))
        flat = np.column_stack([u.ravel(), v.ravel()]) + rng.uniform(-0.05, 0.05, (u.size, 2))
    else:
        flat = rng.uniform(0, 40, (2500, 2))
    return np.column_stack([flat, 0.004 * (flat[:, 0] - 20) ** 2])


@pytest.mark.variants(3)
@pytest.mark.parametrize("seed", range(60))
def test_copies_count_as_one_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    skin = draw_skin(rng, in_rows=bool(seed % 2))
    copies, jitter, shared = int(rng.integers(2, 41)), NOISE * rng.uniform(), rng.random() < 0.5
    noise = np.tile(rng.normal(0, NOISE, len(skin)), copies) if shared else rng.normal(0, NOISE, copies * len(skin))
    points = np.tile(skin, (copies, 1)) + rng.normal(0, jitter, (copies * len(skin), 3)) * (0.1 if not shared else 1)
    points[:, 2] += noise
    scan = make_scan(points[rng.permutation(len(points))])
    assert len(skin) * 0.85 < len(scan.points) <= len(skin) * 1.1
    measured, spacing = measure_noise_and_spacing(scan.points)
    once = skin + np.array([0, 0, 1]) * rng.normal(0, NOISE, (len(skin), 1))
    assert spacing == pytest.approx(measure_noise_and_spacing(once)[1], rel=0.1)
    left = np.hypot(NOISE, jitter / np.sqrt(copies)) if shared else NOISE / np.sqrt(copies)
    assert measured == pytest.approx(left, rel=0.4)
    assert any("stacks" in note for note in scan.notes)


def scan_rows() -> Floats:
    u, v = np.meshgrid(np.arange(0, 40, 0.05), np.arange(0, 40, 2.0))
    return np.column_stack([u.ravel(), v.ravel(), 0 * u.ravel()])


def scan_wall() -> Floats:
    """Both sides of a thin wall, in rows that lie opposite each other."""
    u, v = np.meshgrid(np.arange(0, 40, 1.0), np.arange(0, 40, 1.0))
    sides = [np.column_stack([u.ravel(), v.ravel(), np.full(u.size, z)]) for z in (0.0, 0.15)]
    return np.concatenate(sides) + np.random.default_rng(1).normal(0, 0.005, (2 * u.size, 3))


def scan_twice() -> Floats:
    """Two scans of one skin, each at random."""
    return np.concatenate([draw_skin(np.random.default_rng(seed), in_rows=False) for seed in (1, 2)])


def scan_densely() -> Floats:
    """Points closer together than they are exact."""
    rng = np.random.default_rng(3)
    return np.column_stack([rng.uniform(0, 10, (40_000, 2)), rng.normal(0, 0.1, 40_000)])


@pytest.mark.parametrize("make", [scan_rows, scan_wall, scan_twice, scan_densely])
def test_what_lies_close_is_not_a_stack(make) -> None:
    assert find_stacks(make()) is None


def test_a_few_exposures_of_one_region() -> None:
    skin = draw_skin(np.random.default_rng(5), in_rows=False)
    again = skin[skin[:, 0] < 25]
    scan = make_scan(np.concatenate([skin, again + 1e-4, again - 1e-4]))
    assert len(scan.points) == pytest.approx(len(skin), rel=0.02)


def test_what_a_point_has_besides_its_place_is_that_of_the_first_of_its_stack() -> None:
    skin = draw_skin(np.random.default_rng(5), in_rows=True)
    normals = np.tile([0.0, 0.0, 1.0], (2 * len(skin), 1))
    colours = np.arange(2 * len(skin))[:, None].repeat(3, axis=1).astype(np.uint8)
    scan = make_scan(np.concatenate([skin, skin + 1e-5]), normals, colours=colours)
    assert np.allclose(scan.points, skin + 5e-6)
    assert np.array_equal(scan.colours, colours[: len(skin)])
    assert scan.normals is not None
    assert len(scan.normals) == len(skin)
