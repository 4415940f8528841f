"""A wide loss lies elsewhere in a pose nearby, unless skin that is not worn would come to lie outside."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import DAMAGE, INTACT, Deviation, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.pipeline.finding.coverage import inspect_skin
from damageest.stages.scan.simulate import Simulate
from damageest.trust.doubts.wide_loss import measure_elsewhere
from tests.damaged_box import SIZE, box

TOLERANCE, DEPTH = 0.2, 0.6
X, Y, Z = np.array(SIZE) / 2


def measure(sound: float) -> float:
    """The top of a box is worn, but for a share of it at both ends of x."""
    part = box()
    points = np.array(Simulate.model_validate({"points": 20_000, "noise": 0.03, "seed": 3}).run("mm", part).points)
    worn = (points[:, 2] > Z - 0.2) & (np.abs(points[:, 0]) < (1 - sound) * X)
    points[worn, 2] -= DEPTH
    distance, face = signed_distance(points, part)
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    deviation = Deviation(distance, face, label)
    scan = Scan(points, noise=0.03, spacing=0.6)
    field = ScanField(part, scan, deviation, TOLERANCE)
    skin, *_ = inspect_skin(field, None)
    cells = skin.cells
    removed = (cells.normals[:, 2] > 0.9) & (np.abs(cells.centres[:, 0]) < (1 - sound) * X)
    members = np.flatnonzero(label == DAMAGE)
    return measure_elsewhere(field, members, skin, removed)


def test_wear_of_a_whole_face_may_be_that_of_the_other() -> None:
    assert measure(0.0) > 0.9


@pytest.mark.parametrize("sound", [0.3])
def test_skin_that_is_not_worn_holds_it(sound: float) -> None:
    assert measure(sound) == 0.0
