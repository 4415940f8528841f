"""A scan after a step is read as the job reads its scan, and may show the repaired zone alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

import damageest
from damageest.artefacts import Floats
from damageest.geometry.solids import to_arrays, to_manifold
from damageest.inspection.aim import Aim, read_aim
from damageest.inspection.compare import Inspection, Question, ask, inspect_step
from damageest.io.meshes import write_points
from tests import damaged_box

TOLERANCE, HOT = 0.3, 1 + 80 * 23e-6
JOB = {
    "version": 1, "tolerance": TOLERANCE, "align": "none", "adapt": "none", "report": "none",
    "allowance": {"use": "milling", "outer": 1.0, "overlap": 0.5}, "export": {"format": "ply"},
    "temperature": {"part": 100, "expansion": 23e-6},
    "inspect": {"elsewhere": "listed", "defect": 5.0},
}  # fmt: skip
"""Of a hot box whose files are in inches."""


def sample(body: Manifold, spacing: float = 0.7) -> Floats:
    mesh = trimesh.Trimesh(*to_arrays(body), process=False)
    points, face = trimesh.sample.sample_surface(mesh, int(mesh.area / spacing**2), seed=0)
    away = np.random.default_rng(0).normal(0, 0.02, len(points))
    return np.asarray(points + away[:, None] * mesh.face_normals[face])


def write(path: Path, points: Floats, scale: float = HOT / 25.4) -> Path:
    x, y, z = (scale * points).T
    write_points(path, {"x": x, "y": y, "z": z})
    return path


@pytest.fixture(scope="module")
def aim(tmp_path_factory: pytest.TempPathFactory) -> Aim:
    folder = tmp_path_factory.mktemp("asked")
    damaged = to_manifold(damaged_box.box()) - Manifold.sphere(6, 64).translate((0, 0, 10))
    before = write(folder / "before.ply", sample(damaged))
    job = {**JOB, "scan": {"use": "file", "path": str(before), "unit": "in"}}
    damageest.run(job, part=damaged_box.box(), output=folder / "out")
    return read_aim(folder / "out", "milled")


def inspect(aim: Aim, points: Floats, tmp_path: Path, scale: float = HOT / 25.4, **asked: object) -> Inspection:
    return inspect_step(aim, write(tmp_path / "after.ply", points, scale), ask(aim, {"same_setup": True, **asked}))


@pytest.mark.slow
def test_unit_and_temperature_are_those_of_the_job(aim: Aim, tmp_path: Path) -> None:
    found = inspect(aim, sample(to_manifold(damaged_box.box())), tmp_path)
    assert found.whole.outcome == "met", found
    assert found.defect == 5.0
    assert found.off < 0.04  # hot, it is up to 0.04 mm larger than at 20 degrees


@pytest.mark.slow
def test_unit_and_temperature_may_be_others(aim: Aim, tmp_path: Path) -> None:
    cold = sample(to_manifold(damaged_box.box()))
    found = inspect(aim, cold, tmp_path, 1.0, scan_unit="mm", part_temperature=20.0)
    assert found.whole.outcome == "met", found
    assert found.off < 0.04


@pytest.mark.slow
@pytest.mark.parametrize("low", [False, True])
def test_the_repaired_zone_alone_is_enough_in_the_same_setup(aim: Aim, tmp_path: Path, low: bool) -> None:
    body = to_manifold(damaged_box.box())
    if low:
        body = body - Manifold.cylinder(4, 2.5, 2.5, 48).translate((1, 1, 9.3))
    points = sample(body, 0.5)
    found = inspect(aim, points[np.linalg.norm(points - (0, 0, 10), axis=1) < 7.5], tmp_path)
    assert found.whole.outcome == ("not met" if low else "met"), found


@pytest.mark.slow
def test_the_job_decides_what_nobody_asks(aim: Aim) -> None:
    assert ask(aim, {"defect": None}) == Question(defect=5.0, elsewhere="listed")
    assert ask(aim, {"defect": 2.0, "elsewhere": "decides"}) == Question(defect=2.0)
    assert aim.folder.content["provenance"]["job"]["temperature"]["part"] == 100
