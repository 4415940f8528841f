"""On a part that is nearly symmetric, poses are told apart by what differs, or are listed and doubted."""

from __future__ import annotations

import numpy as np
import pytest
from align_scenes import make_bracket, make_plate, measure_apart, scene, watch_by_camera

from damageest.artefacts import Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align.register import Register
from damageest.stages.align.search.weigh_poses import DECISIVE, weigh_poses
from damageest.stages.align.surface.plane_grid import PartSurface

RIGHT = 0.03
"""Distance from the true pose, in diagonals, up to which a pose is right."""


def is_told(part: Part, scan: Scan, pose: Pose) -> bool:
    """Whether the pose is right, or the right one is listed and all are doubted."""
    if measure_apart(part, pose.T_part_scan, scan) < RIGHT:
        return True
    others = np.zeros((0, 4, 4)) if pose.alternatives is None else pose.alternatives
    return bool(pose.doubts) and min((measure_apart(part, T, scan) for T in others), default=1.0) < RIGHT


@pytest.mark.slow
def test_a_camera_does_not_show_which_hole_is_larger() -> None:
    """A pose that is turned by 180 degrees was taken, without a doubt."""
    part = make_plate(0.6)
    scan, tolerance = watch_by_camera(part, 1, 4000, 0.3)
    pose = Register().run(scan, part, tolerance)
    assert is_told(part, scan, pose)
    assert "other_poses" in [doubt.code for doubt in pose.doubts]


@pytest.mark.slow
def test_a_fine_scan_shows_it() -> None:
    part = make_plate()
    T = np.eye(4)
    T[:3, 3] = 10.0
    points = scene_points(part)
    pose = Register().run(Scan(points - 10.0, noise=0.05), part, 0.2)
    assert np.abs(pose.T_part_scan - T).max() < 0.02
    assert pose.alternatives is None
    assert not pose.doubts


def scene_points(part: Part) -> np.ndarray:
    from damageest.geometry.sampling import sample_by_area

    rng = np.random.default_rng(0)
    points, _ = sample_by_area(part, 15_000, rng)
    return points + rng.normal(0, 0.05, points.shape)


@pytest.mark.variants(slow=6)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 21))
def test_no_camera_scan_is_turned_and_sure(seed: int) -> None:
    part = make_plate(0.6) if seed % 2 else make_bracket()
    scan, tolerance = watch_by_camera(part, seed, 3000 + 200 * seed, 0.1 * (seed % 5))
    try:
        pose = Register().run(scan, part, tolerance)
    except StageError:  # a plate that is seen edge-on has no pose
        return
    assert is_told(part, scan, pose)


@pytest.mark.parametrize(("wave", "is_decided"), [(0.0, True), (0.5, False)])
def test_waves_make_the_evidence_weaker(wave: float, is_decided: bool) -> None:
    """A step of 0.4 mm decides where the noise of points is 0.1 mm, and does not in waves of 0.5 mm."""
    rng = np.random.default_rng(0)
    part, _ = scene("cuboid", seed=0, points=100)
    target = PartSurface(part)
    size = part.diagonal
    points = scene_points(part)
    points += wave * np.sin(points.sum(axis=1) / (0.1 * size))[:, None]
    moved = np.eye(4)
    moved[0, 3] = 0.4
    assert (weigh_poses(target, rng.permutation(points), np.eye(4), moved[None], 0.1)[0] > DECISIVE) == is_decided
