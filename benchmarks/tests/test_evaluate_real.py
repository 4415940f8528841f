"""The crude difference finds a known loss; and the real die comes out, where its data is there."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.real.case import PARTS, RealCase, run_real
from damageest_benchmarks.real.reference import measure_range, sample

DATA = Path(os.environ.get("DAMAGEEST_REAL_DATA", ""))
DIE = PARTS[0]


@pytest.mark.slow
def test_the_crude_difference_is_that_of_a_worn_face() -> None:
    """A fifth of the top of a box is 0.5 lower; the scan stands in another place."""
    box = trimesh.creation.box((40, 30, 20)).subdivide_to_size(0.8)
    vertices = np.array(box.vertices)
    worn = (vertices[:, 2] > 9.9) & (np.abs(vertices[:, 0]) <= 4)
    area = float(box.area_faces[worn[box.faces].all(axis=1)].sum())
    moved = vertices - [0, 0, 0.5] * worn[:, None] + np.array([1.0, 2.0, 3.0])
    part, scan = sample(vertices, box.faces, 40_000), sample(moved, box.faces, 40_000, seed=1)
    pose = np.eye(4)
    pose[:3, 3] = [-1.0, -2.0, -3.02]
    found = measure_range(part, scan, pose, 0.2)
    shifted, fitted = found[0][1], found[-1][1]
    assert fitted.off < shifted.off
    assert 0.95 * 0.5 * area < fitted.deeper < 1.15 * 0.5 * area
    assert fitted.deeper <= fitted.down < 1.25 * 0.5 * area


@pytest.mark.slow
@pytest.mark.skipif(not (DATA / "die" / DIE.scan).is_file(), reason="DAMAGEEST_REAL_DATA names no folder with a die")
def test_the_real_die_comes_out() -> None:
    """Its bore is worn by 0.3 to 0.5 mm: the site is likely, and its interval holds the crude difference."""
    row = run_real(RealCase(f"{DATA}", DIE, "own", "0.2"))
    assert row["verdict"] == "likely", row
    assert row["held"], row
    assert row["notes"] <= 8
