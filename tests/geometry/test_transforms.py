"""Rigid transforms there and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from damageest.artefacts import Part, Pose
from damageest.geometry.transforms import invert_pose, make_motions, move_mesh, move_points
from tests.geometry.shapes import draw_pose, torus

RING = torus()


@given(st.integers(0, 10_000), st.sampled_from([1.0, 1e5]))
@settings(max_examples=50, deadline=None)
def test_a_pose_and_its_inverse_leave_the_mesh_where_it_was(seed: int, reach: float) -> None:
    pose = Pose(draw_pose(np.random.default_rng(seed), reach))
    moved = move_mesh(RING, pose.T_part_scan)
    assert moved.volume == pytest.approx(RING.volume)
    assert np.array_equal(moved.faces, RING.faces)
    back = move_mesh(moved, invert_pose(pose))
    assert np.abs(back.vertices - RING.vertices).max() < 1e-14 * (100 + 20 * reach)
    assert invert_pose(pose) @ pose.T_part_scan == pytest.approx(np.eye(4), abs=1e-14 * (10 + 10 * reach))


def test_the_pose_maps_the_scanners_frame_to_the_parts() -> None:
    T = np.array([[0.0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    assert invert_pose(Pose(T)) @ [5, 6, 7, 1] == pytest.approx([0, 0, 0, 1])
    assert invert_pose(Pose(T)) @ [5, 7, 7, 1] == pytest.approx([1, 0, 0, 1])


def test_a_part_stays_a_part_and_without_transform_the_same() -> None:
    part = Part(RING.vertices, RING.faces, "in", "a.step", notes=("read",))
    moved = move_mesh(part, draw_pose(np.random.default_rng(0)))
    assert isinstance(moved, Part)
    assert (moved.unit, moved.path, moved.notes) == ("in", "a.step", ("read",))
    assert move_mesh(part, None) is part


def test_motions_turn_about_the_origin_then_shift() -> None:
    quarter, still = make_motions(np.array([[0, 0, np.pi / 2, 1, 2, 3], [0, 0, 0, 0, 0, 0]]))
    assert move_points(np.array([[1.0, 0, 0]]), quarter)[0] == pytest.approx([1, 3, 3], abs=1e-12)
    assert (still == np.eye(4)).all()
