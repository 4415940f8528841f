"""Two scans of a part on a table: what stands on it decides where it was, not the table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold
from scipy.spatial.transform import Rotation

from damageest.artefacts import Floats
from damageest.geometry.solids import to_arrays
from damageest.io.meshes import write_points
from damageest.registry import Registry
from damageest.stages.part.earlier_scan import EarlierScan
from damageest.stages.scan.file import ScanFile
from tests.pipeline.halfway import run_until

SPACING, NOISE, TOLERANCE = 1.0, 0.02, 0.15
BODY = (
    Manifold.cube((60, 40, 25))
    - Manifold.cube((22, 60, 12)).translate((38, -5, 14))
    + Manifold.cylinder(14, 6, 6, 64).translate((15, 12, 25))
    + Manifold.cube((8, 8, 10)).translate((5, 39, 5))
)


def scan(turn: Floats, seed: int) -> tuple[Floats, Floats]:
    """Points and normals of the body, turned and put on a table, as seen from above and the sides."""
    mesh = trimesh.Trimesh(*to_arrays(BODY), process=False)
    points, face = trimesh.sample.sample_surface(mesh, int(mesh.area / SPACING**2), seed=seed)
    points, normals = points @ turn.T, mesh.face_normals[face] @ turn.T
    points = points - [0, 0, points[:, 2].min()]
    up = normals[:, 2] > -0.9
    points, normals = points[up], normals[up]
    rng = np.random.default_rng(seed)
    flat = np.column_stack([rng.uniform(-80, 80, (20_000, 2)) + points[:, :2].mean(axis=0), np.zeros(20_000)])
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    flat = flat[~((flat[:, :2] > low) & (flat[:, :2] < high)).all(axis=1)]
    normals = np.concatenate([normals, np.tile([0.0, 0.0, 1.0], (len(flat), 1))])
    points = np.concatenate([points, flat])
    return points + NOISE * rng.normal(size=len(points))[:, None] * normals, normals


def write(path: Path, points: Floats, normals: Floats) -> Path:
    write_points(path, dict(zip(("x", "y", "z", "nx", "ny", "nz"), np.column_stack([points, normals]).T, strict=True)))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [0.0, 180.0])
def test_a_part_that_was_laid_on_its_back_is_found(degrees: float, tmp_path: Path, registry: Registry) -> None:
    turn = Rotation.from_euler("xz", [degrees, 35], degrees=True).as_matrix()
    before = write(tmp_path / "before.ply", *scan(np.eye(3), 1))
    after = write(tmp_path / "after.ply", *scan(turn, 2))
    part = EarlierScan.model_validate({"path": str(before)}).run("mm")
    later = ScanFile.model_validate({"path": str(after)}).run("mm")
    halfway = run_until("place_scan", part, later, registry, tolerance=TOLERANCE)
    pose, told = halfway.state.pose, [note.code for note in halfway.state.warnings]
    assert np.abs(pose.T_part_scan[:3, :3] - turn.T).max() < 0.01
    assert ("table_aside" in told) == (degrees != 0)
    assert not any(doubt.code == "shared_table" for doubt in pose.doubts)
