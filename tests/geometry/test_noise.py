"""Noise and spacing are recovered where they are known."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.geometry.noise import measure_noise_and_spacing


def grooved():
    """A block with many grooves: nearly every neighbourhood is within a few millimetres of an edge."""
    teeth = [trimesh.creation.box((2, 50, 8)).apply_translation((4.0 * k, 0, 9)) for k in range(-9, 10)]
    return trimesh.boolean.union([trimesh.creation.box((80, 50, 10)), *teeth], engine="manifold")


PARTS = {
    "block": trimesh.creation.box((80, 50, 30)),
    "grooved": grooved(),
    "ring": trimesh.creation.torus(30, 8, major_sections=512, minor_sections=256),
}


def scan(name, count, sigma, seed=0):
    mesh = PARTS[name]
    points, face = trimesh.sample.sample_surface(mesh, count, seed=seed)
    noise = np.random.default_rng(seed).normal(size=count) * sigma
    return points + noise[:, None] * mesh.face_normals[face]


@pytest.mark.variants(3)
@pytest.mark.parametrize("name", sorted(PARTS))
@pytest.mark.parametrize("relative", [2e-4, 5e-4, 2e-3])
def test_noise_is_recovered_on_edges_and_curves(name, relative):
    sigma = relative * float(np.linalg.norm(PARTS[name].extents))
    noise, _ = measure_noise_and_spacing(scan(name, 30_000, sigma))
    assert noise == pytest.approx(sigma, rel=0.12)


@pytest.mark.parametrize("name", ["block", "grooved"])
def test_a_scan_without_noise_has_none(name):
    noise, spacing = measure_noise_and_spacing(scan(name, 30_000, 0.0))
    assert noise < 1e-6 * spacing


def test_a_curved_scan_without_noise_has_next_to_none():
    noise, _ = measure_noise_and_spacing(scan("ring", 30_000, 0.0))
    assert noise < 2e-5 * float(np.linalg.norm(PARTS["ring"].extents))


def test_damage_outliers_and_clutter_do_not_inflate_the_noise():
    rng = np.random.default_rng(0)
    rough = rng.uniform(-1, 1, (6000, 3)) * [10, 10, 2] + [0, 0, 14]
    points = np.concatenate([scan("block", 60_000, 0.05), rough, rng.uniform(-60, 60, (500, 3))])
    assert measure_noise_and_spacing(points)[0] == pytest.approx(0.05, rel=0.1)


@pytest.mark.slow
def test_dense_scans_are_measured_over_patches_wider_than_the_noise():
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(0, 10, (100_000, 2)), rng.normal(size=100_000) * 0.1])  # spacing 0.03
    assert measure_noise_and_spacing(flat)[0] == pytest.approx(0.1, rel=0.1)


def test_spacing_of_a_grid_is_its_pitch_and_uneven_density_does_not_hide_it():
    x, y = np.meshgrid(np.arange(200) * 0.5, np.arange(200) * 0.5)
    grid = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    assert 0.45 <= measure_noise_and_spacing(grid)[1] <= 0.75
    dense = np.random.default_rng(0).uniform(0, 10, (100_000, 3)) * [1, 1, 0]  # 1 % of the area, most of the points
    assert 0.4 <= measure_noise_and_spacing(np.concatenate([grid, dense + 1e-3]))[1] <= 0.75


def test_spacing_of_scan_lines_is_between_the_lines():
    x, y = np.meshgrid(np.arange(1000) * 0.1, np.arange(100) * 1.0)
    lines = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    assert 0.4 <= measure_noise_and_spacing(lines)[1] <= 1.3


@pytest.mark.slow
def test_noise_and_spacing_scale_with_the_unit_and_not_with_the_place():
    points = scan("block", 30_000, 0.05)
    noise, spacing = measure_noise_and_spacing(points)
    assert measure_noise_and_spacing(points * 1000) == pytest.approx((1000 * noise, 1000 * spacing), rel=1e-6)
    assert measure_noise_and_spacing(points + 1e6) == pytest.approx((noise, spacing), rel=1e-3)


def test_the_answer_repeats_and_tiny_scans_give_zero():
    points = scan("block", 20_000, 0.05)
    assert measure_noise_and_spacing(points) == measure_noise_and_spacing(points)
    assert measure_noise_and_spacing(points[:5]) == (0.0, 0.0)


@pytest.mark.slow
def test_millions_of_points_agree_with_fewer():
    points = scan("ring", 4_000_000, 0.05)
    noise, spacing = measure_noise_and_spacing(points)
    assert noise == pytest.approx(0.05, rel=0.1)
    assert spacing == pytest.approx(1.2 * np.sqrt(PARTS["ring"].area / 4e6), rel=0.4)
