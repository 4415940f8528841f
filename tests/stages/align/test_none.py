"""No alignment: the given pose, and how well the scan lies on the part in it."""

from __future__ import annotations

import numpy as np
import pytest
from align_scenes import scene
from pydantic import ValidationError

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
    assert "only" in KnownPose().run(scan, part, 4 * scan.noise).notes[0]


def test_mirror_is_refused() -> None:
    with pytest.raises(ValidationError, match="mirrors"):
        KnownPose.model_validate({"T_part_scan": np.diag([1.0, 1.0, -1.0, 1.0]).tolist()})
