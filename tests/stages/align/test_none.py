"""No alignment: the given pose, and how well the scan lies on the part in it."""

from __future__ import annotations

import numpy as np
import pytest
from align_scenes import scene
from pydantic import ValidationError

from damageest.artefacts import Scan
from damageest.errors import StageError
from damageest.stages.align.none import KnownPose


def test_identity_on_a_scan_in_place() -> None:
    part, scan = scene("block", seed=1, clutter=0.0)
    assert scan.truth is not None
    pose = KnownPose().run(scan.move(scan.truth.T_part_scan), part, 4 * scan.noise)
    assert (pose.T_part_scan == np.eye(4)).all()
    assert pose.inliers > 0.99
    assert pose.rms == pytest.approx(scan.noise, rel=0.1)
    assert not pose.notes


def test_given_pose_is_used_and_compared_with_the_scan() -> None:
    part, scan = scene("block", seed=1, clutter=0.0)
    assert scan.truth is not None
    T = scan.truth.T_part_scan
    pose = KnownPose.model_validate({"T_part_scan": T.tolist()}).run(scan, part, 4 * scan.noise)
    assert (pose.T_part_scan == T).all()
    assert pose.inliers > 0.99


def test_elsewhere_is_refused() -> None:
    part, scan = scene("block", seed=1)
    with pytest.raises(StageError, match="does not lie on the part in the given pose: 0%"):
        KnownPose().run(scan, part, 4 * scan.noise)


@pytest.mark.slow
@pytest.mark.parametrize("missing", [0.33, pytest.param(0.0, marks=pytest.mark.slow)])
def test_a_millimetre_off_is_refused_and_a_fraction_of_the_tolerance_is_not(missing: float) -> None:
    part, scan = scene("block", seed=1, missing=missing)
    assert scan.truth is not None
    placed, tolerance = scan.move(scan.truth.T_part_scan), 4 * scan.noise
    assert not KnownPose().run(placed, part, tolerance).doubts
    KnownPose().run(Scan(placed.points + np.array([0.5 * tolerance, 0, 0]), noise=scan.noise), part, tolerance)
    with pytest.raises(StageError, match=r"moved by (0\.99\d?|1|1\.0\d?) mm and turned by") as caught:
        KnownPose().run(Scan(placed.points + np.array([1.0, 0, 0]), noise=scan.noise), part, tolerance)
    assert "align: icp" in caught.value.remedy


def test_mirror_is_refused() -> None:
    with pytest.raises(ValidationError, match="mirrors"):
        KnownPose.model_validate({"T_part_scan": np.diag([1.0, 1.0, -1.0, 1.0]).tolist()})
