"""Fields of displacement, and what of a displacement is not rigid."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry.transforms import remove_rigid
from damageest.trust.form.form_fields import BENDS, EVERY, SCALE, STRETCHES, TWISTS, choose_frame
from tests.geometry.shapes import draw_pose
from tests.trust.form_scenes import draw_skin, get_part

POINTS = draw_skin(count=2000)[0]
FRAME = choose_frame(get_part(), POINTS)


def test_a_scale_is_the_sum_of_its_stretches() -> None:
    assert FRAME.evaluate(SCALE, POINTS)[0] == pytest.approx(FRAME.evaluate(STRETCHES, POINTS).sum(axis=0))
    assert FRAME.evaluate(SCALE, POINTS)[0] == pytest.approx((POINTS - FRAME.centre) / FRAME.half)


def test_bending_and_twisting_strain_no_cross_section() -> None:
    across = np.array([[0.0, 1, 0], [0, 0, 1], [0, 1, 1]])
    for field in (BENDS[0], TWISTS[0]):
        moved = field.evaluate(across)
        assert np.einsum("ij,ij->i", moved, across) == pytest.approx(0)


def test_no_field_is_rigid() -> None:
    for one in FRAME.evaluate(EVERY, POINTS):
        left = remove_rigid(POINTS, one, np.ones(len(POINTS)))
        assert np.linalg.norm(left, axis=1).max() > 0.05 * np.linalg.norm(one, axis=1).max()


def test_a_rigid_displacement_leaves_nothing() -> None:
    T = draw_pose(np.random.default_rng(3))
    small = 1e-3 * np.cross(T[:3, 3], POINTS) + T[0, :3]
    assert np.abs(remove_rigid(POINTS, small, np.ones(len(POINTS)))).max() < 1e-9


def test_the_frame_follows_a_part_that_lies_askew() -> None:
    from damageest.geometry.transforms import move_mesh

    T = draw_pose(np.random.default_rng(4))
    askew = choose_frame(move_mesh(get_part(), T), POINTS @ T[:3, :3].T + T[:3, 3])
    along = np.abs(askew.axes @ T[:3, :3])
    assert along.max(axis=1) == pytest.approx(1, abs=0.02)
