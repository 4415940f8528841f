"""How a damage volume depends on a free motion of the pose."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from damageest.artefacts import FreeMotion, Part, Pose, Solid
from damageest.trust.interval.free_pose import (
    compare_other_poses,
    describe_motion,
    measure_dependence,
    measure_hidden_wear,
)

LENGTH, WIDTH, HEIGHT, DEPTH = 40.0, 30.0, 20.0, 0.5


def make_slab() -> tuple[Part, Solid]:
    """A box, and the layer that it lost on top."""
    box = trimesh.creation.box((LENGTH, WIDTH, HEIGHT))
    layer = trimesh.creation.box((LENGTH, WIDTH, DEPTH))
    layer.apply_translation((0, 0, (HEIGHT - DEPTH) / 2))
    return Part(box.vertices, box.faces), Solid(layer.vertices, layer.faces)


@pytest.mark.parametrize(
    ("motion", "rate", "moved"),
    [
        (FreeMotion((0, 0, 1), -1, 1), -LENGTH * WIDTH, LENGTH * WIDTH),
        (FreeMotion((1, 0, 0), -1, 1), 0.0, 0.0),
        (FreeMotion((0, 1, 0), -1, 1, (-LENGTH / 2, 0, 0), 1 / LENGTH), LENGTH * WIDTH / 2, LENGTH * WIDTH / 2),
    ],
)
def test_rates_are_those_of_the_inner_surface(motion: FreeMotion, rate: float, moved: float) -> None:
    part, damage = make_slab()
    (found,) = measure_dependence(damage, part, Pose(np.eye(4), free=(motion,)))
    assert found.rate == pytest.approx(rate, abs=1e-6)
    assert found.moved == pytest.approx(moved, rel=0.05, abs=1e-6)


def test_the_ends_are_the_volumes_at_the_ends_of_the_motion() -> None:
    part, damage = make_slab()
    pose = Pose(np.eye(4), free=(FreeMotion((0, 0, 1), -0.1, 0.05),))
    (found,) = measure_dependence(damage, part, pose)
    assert found.ends == pytest.approx((-0.05 * LENGTH * WIDTH, 0.1 * LENGTH * WIDTH))
    assert describe_motion(pose.free[0], "mm")


def turn_about_z(degrees: float) -> np.ndarray:
    T = np.eye(4)
    T[:2, :2] = Rotation.from_euler("z", degrees, degrees=True).as_matrix()[:2, :2]
    return T


@pytest.mark.parametrize(("degrees", "low", "high"), [(180, 0.0, 0.0), (90, 0.2, 0.4)])
def test_another_pose_matters_where_its_skin_is_elsewhere(degrees: float, low: float, high: float) -> None:
    part, damage = make_slab()
    pose = Pose(np.eye(4), alternatives=turn_about_z(degrees)[None])
    assert low <= compare_other_poses(damage, part, pose, 0.1) <= high
    assert compare_other_poses(damage, part, Pose(np.eye(4)), 0.1) == 0


def test_wear_of_a_face_that_moves_the_pose_is_what_the_face_sweeps() -> None:
    part, _ = make_slab()
    free = FreeMotion((0, 0, 1), -0.3, 0.1)
    assert measure_hidden_wear(part, Pose(np.eye(4), free=(free,))) == pytest.approx(0.3 * LENGTH * WIDTH)
    assert measure_hidden_wear(part, Pose(np.eye(4))) == 0


def test_a_pose_that_is_fixed_asks_nothing() -> None:
    part, damage = make_slab()
    assert measure_dependence(damage, part, Pose(np.eye(4))) == ()
