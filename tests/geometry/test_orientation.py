"""Normals of known damage point to the lost side, whatever their signs were."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Floats
from damageest.geometry.orientation import turn_toward_void
from damageest.geometry.sampling import sample_by_area
from tests.geometry.shapes import draw_pose
from tests.stages._open import bowl, pipe

NONE = np.empty((0, 3))


def sample_pit(count: int = 800) -> tuple[Floats, Floats]:
    """Points on the lower half of a ball of radius 6 about the origin, and their normals toward the void."""
    points, _ = sample_by_area(bowl(6, 0, 0.1), count, np.random.default_rng(0))
    return points, -points / np.linalg.norm(points, axis=1)[:, None]


def sample_lid(count: int = 400) -> tuple[Floats, Floats, Floats]:
    """The skin that the pit took away, its normals and areas."""
    rng = np.random.default_rng(1)
    angle, radius = rng.uniform(0, 2 * np.pi, count), 6 * np.sqrt(rng.random(count))
    skin = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(count)])
    return skin, np.tile([0.0, 0, 1], (count, 1)), np.full(count, np.pi * 36 / count)


@given(st.integers(0, 10_000), st.sampled_from([0.0, 1.0, 1e5]))
@settings(max_examples=10, deadline=None)
def test_a_pit_opens_to_its_missing_skin_in_any_frame_from_any_signs(seed: int, reach: float) -> None:
    rng = np.random.default_rng(seed)
    points, toward = sample_pit()
    lid, lid_normals, areas = sample_lid()
    T = draw_pose(rng, reach)
    R, t = T[:3, :3], T[:3, 3]
    signs = rng.choice([-1.0, 1.0], len(points))[:, None]
    zero = np.zeros_like(points)
    turned = turn_toward_void(
        points @ R.T + t, signs * toward @ R.T, zero, lid @ R.T + t, lid_normals @ R.T, areas, 0.3
    )
    assert turned == pytest.approx(toward @ R.T)


def test_without_missing_skin_the_nominal_skin_decides() -> None:
    points, toward = sample_pit()
    for sign in (1.0, -1.0):
        above = np.tile([0.0, 0, sign], (len(points), 1))
        turned = turn_toward_void(points, toward, above, NONE, NONE, np.empty(0), 0.3)
        assert turned == pytest.approx(sign * toward)


def test_skin_on_the_far_side_of_a_void_does_not_turn_the_near_one() -> None:
    """A hole through a plate: skin is missing at both ends, which face opposite ways; normals point to the axis."""
    points, _ = sample_by_area(pipe(3, -8, 8), 1500, np.random.default_rng(0))
    toward = -points * [1, 1, 0] / 3
    toward /= np.linalg.norm(toward, axis=1)[:, None]
    skin, normals, areas = sample_lid()
    skin = skin / 2
    both = np.concatenate([skin + np.array([0, 0, 8]), skin - np.array([0, 0, 8])])
    ways = np.concatenate([normals, -normals])
    signs = np.random.default_rng(2).choice([-1.0, 1.0], len(points))[:, None]
    turned = turn_toward_void(points, signs * toward, np.zeros_like(points), both, ways, np.tile(areas / 4, 2), 0.3)
    assert turned == pytest.approx(toward)
