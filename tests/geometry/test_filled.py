"""Sheets that software put where the scanner saw nothing are told from skin by their lack of noise."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Floats
from damageest.geometry.filled import find_filled
from damageest.geometry.noise import measure_noise_and_spacing

NOISE = 0.02


def draw_ball(rng: np.random.Generator, count: int = 12_000, noise: float | Floats = NOISE) -> Floats:
    """Points of a ball of radius 10, with noise along the radius."""
    points = rng.normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    return points * (10 + rng.normal(size=count) * noise)[:, None]


def draw_sheet(rng: np.random.Generator, count: int = 1500) -> Floats:
    """A smooth sheet within the ball, up to where it meets the skin."""
    flat = rng.uniform(-8, 8, (4 * count, 2))
    flat = flat[np.hypot(*flat.T) < 7.8][:count]
    return np.column_stack([flat, -6 + 0.02 * (flat**2).sum(axis=1)])


def ask(points: Floats) -> np.ndarray:
    return find_filled(points, measure_noise_and_spacing(points)[0])


def test_a_smooth_sheet_is_found_and_the_skin_is_left() -> None:
    rng = np.random.default_rng(1)
    skin = draw_ball(rng)
    skin = skin[skin[:, 2] > -6]
    sheet = draw_sheet(rng)
    filled = ask(np.concatenate([skin, sheet]))
    assert filled[len(skin) :].mean() > 0.97
    beside = np.hypot(*skin[:, :2].T) < 9
    assert not filled[: len(skin)][(skin[:, 2] > -4) & beside].any()


@pytest.mark.parametrize("share", [0.0, 0.2, 0.5])
def test_skin_with_less_noise_than_other_skin_is_left(share: float) -> None:
    rng = np.random.default_rng(2)
    noise = np.where(np.arange(12_000) < share * 12_000, NOISE / 4, NOISE)
    points = draw_ball(rng, noise=noise[np.argsort(rng.random(12_000))])
    assert not ask(points).any()


def test_a_surface_without_any_noise_is_left() -> None:
    """Its scatter is that of its chords: none on flat faces, some on round ones."""
    mesh = trimesh.creation.cylinder(10, 30, sections=48)
    points = trimesh.sample.sample_surface(mesh, 12_000, seed=4)[0]
    assert not ask(np.asarray(points)).any()
    assert not find_filled(np.asarray(points), 0.0).any()


def test_a_part_of_flat_faces_and_noise_is_left() -> None:
    rng = np.random.default_rng(5)
    points = np.asarray(trimesh.sample.sample_surface(trimesh.creation.box((30, 20, 10)), 12_000, seed=5)[0])
    assert not ask(points + rng.normal(0, NOISE, points.shape)).any()
