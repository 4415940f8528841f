"""What is said of the numbers of a scan: normals that are none, and coordinates with too few digits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from damageest.io.meshes import write_points
from damageest.io.scans import make_scan, read_scan

POINTS = np.random.default_rng(5).uniform(0, 100, (500, 3))


@pytest.mark.parametrize(("none", "says"), [(500, "all normals"), (3, "3 of 500 normals")])
def test_normals_that_are_none_are_counted(none: int, says: str) -> None:
    normals = np.tile([0.0, 0.0, 1.0], (500, 1))
    normals[:none] = 0
    scan = make_scan(POINTS, normals)
    assert scan.normals is None
    assert any(note.startswith(says) for note in scan.notes)


@pytest.mark.parametrize(("shift", "kind", "step"), [(4.5e6, "f4", 0.5), (0, "f4", 0), (4.5e6, "f8", 0)])
def test_steps_of_single_precision_are_named(shift: float, kind: str, step: float, tmp_path: Path) -> None:
    points = (POINTS + np.array([shift, 0, 0])).astype(kind)
    write_points(tmp_path / "scan.ply", dict(zip("xyz", points.T, strict=True)))
    scan = read_scan([tmp_path / "scan.ply"], "mm")
    told = [one for one in scan.warnings if one.code == "coarse_numbers"]
    assert [one.amount for one in told] == ([step] if step else [])
    assert all("200 steps across" in one.text for one in told)


def test_a_coordinate_that_is_the_same_at_all_points_is_told() -> None:
    points = np.random.default_rng(4).uniform(size=(500, 3))
    assert not make_scan(points).notes
    points[:, 1] = -2147483.648
    (note,) = make_scan(points).notes
    assert note.startswith("y is -2147483.648 at all 500 points: the file has lost this coordinate")
    assert not make_scan(points[:1]).notes
