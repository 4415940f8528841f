"""The step that puts the adapted part in the place of the part as designed."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import FreeMotion, Pose, Reason
from damageest.pipeline.placing.adapt import recheck_pose

DOUBT = Reason("pose_free", "the scan does not fix the pose", "contradicts")
FREE = FreeMotion((0.0, 0.0, 1.0), -1.0, 1.0)
POINTS = np.random.default_rng(0).uniform(-10, 10, (500, 3))


def shifted(by: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = by
    return T


@pytest.mark.parametrize(("by", "is_settled"), [(0.01, True), (1.0, False)], ids=["agrees", "elsewhere"])
def test_doubts_of_the_part_as_designed_are_asked_anew(by: float, is_settled: bool) -> None:
    pose = Pose(shifted(0.0), doubts=(DOUBT,), free=(FREE,), notes=("free",))
    found = recheck_pose(pose, Pose(shifted(by)), POINTS, 0.2)
    assert np.array_equal(found.T_part_scan, pose.T_part_scan)
    assert (found.doubts, found.free) == (((), ()) if is_settled else ((DOUBT,), (FREE,)))


def test_what_the_adapted_part_leaves_free_is_a_doubt() -> None:
    found = recheck_pose(Pose(shifted(0.0), free=(FREE,)), Pose(shifted(0.0), doubts=(DOUBT,)), POINTS, 0.2)
    assert found.doubts == (DOUBT,)
