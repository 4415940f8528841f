"""The robust fit from a rough pose."""

from __future__ import annotations

import numpy as np
import pytest
from align_scenes import error, scene
from pydantic import ValidationError
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats, Part, Scan
from damageest.errors import StageError
from damageest.stages.align.icp import Icp


def near(part: Part, scan: Scan, degrees: float, shift: float) -> list[list[float]]:
    """The true pose, then turned about the part's centre and shifted by a share of its diagonal."""
    assert scan.truth is not None
    D: Floats = np.eye(4)
    D[:3, :3] = Rotation.from_rotvec([0, 0, degrees], degrees=True).as_matrix()
    D[:3, 3] = part.bounds.mean(0) - D[:3, :3] @ part.bounds.mean(0) + shift * part.diagonal
    return np.asarray(D @ scan.truth.T_part_scan).tolist()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block", pytest.param("blade", marks=pytest.mark.slow)])
def test_damage_does_not_shift_the_fit(name: str) -> None:
    part, scan = scene(name, seed=1, missing=0.33)
    stage = Icp.model_validate({"T_part_scan": near(part, scan, 1.0, 0.004)})
    pose = stage.run(scan, part, 4 * scan.noise)
    assert error(part, pose.T_part_scan, scan) < 0.5
    assert pose.T_part_scan.tobytes() == stage.run(scan, part, 4 * scan.noise).T_part_scan.tobytes()


@pytest.mark.slow
def test_no_pose_given_and_scan_in_place() -> None:
    part, scan = scene("block", seed=2)
    assert scan.truth is not None
    pose = Icp().run(scan.move(scan.truth.T_part_scan), part, 4 * scan.noise)
    assert np.abs(pose.T_part_scan - np.eye(4)).max() < scan.noise


def test_far_off_is_refused() -> None:
    part, scan = scene("block", seed=2)
    with pytest.raises(StageError) as caught:
        Icp.model_validate({"T_part_scan": near(part, scan, 40.0, 0.3)}).run(scan, part, 4 * scan.noise)
    assert "register" in caught.value.remedy


def test_too_few_iterations_are_refused() -> None:
    part, scan = scene("block", seed=2)
    with pytest.raises(StageError):
        Icp.model_validate({"T_part_scan": near(part, scan, 2.0, 0.008), "iterations": 1}).run(
            scan, part, 4 * scan.noise
        )


def test_pose_that_is_not_rigid() -> None:
    with pytest.raises(ValidationError, match="not rigid"):
        Icp.model_validate({"T_part_scan": np.diag([2.0, 2.0, 2.0, 1.0]).tolist()})
