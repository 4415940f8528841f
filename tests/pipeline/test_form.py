"""The model fit on the route: what a run says of it, and what it puts right."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import damageest
from damageest.artefacts import Scan
from damageest.errors import DamageestError
from damageest.io.meshes import write_points, write_stl
from damageest.output.result_json import build_report
from damageest.stages.scan.deformation import Deformation, deform
from tests.trust.form_scenes import TOLERANCE, add_noise, draw_skin, get_part

SETTINGS = ["align=none", "adapt=none", "allowance=none", f"tolerance={TOLERANCE}"]


def dent(points: np.ndarray, normals: np.ndarray, depth: float, width: float) -> np.ndarray:
    """A smooth dent in the top."""
    away = np.linalg.norm(points[:, :2] - [-10.0, -5.0], axis=1)
    deep = depth * np.clip(1 - (away / width) ** 2, 0, None) * (normals[:, 2] > 0.9)
    return points - deep[:, None] * normals


@pytest.mark.slow
def test_only_what_is_much_deeper_than_the_bend_is_proven() -> None:
    points, normals = draw_skin(count=30_000)
    dented = dent(points, normals, 2.5, 8.0)
    scan = Scan(add_noise(deform(dented, Deformation(bend=0.35), get_part())))
    result = damageest.run({"version": 1}, part=get_part(), scan=scan, settings=SETTINGS)
    assert result.fit is not None
    assert result.fit.model == "deformed"
    assert any(note.code == "model_fit" and note.amount == pytest.approx(0.35, rel=0.2) for note in result.warnings)
    deep = [site for site in result.sites if site.max_depth > 2]
    assert len(deep) == 1
    assert deep[0].accepted
    others = [site for site in result.sites if site.max_depth < 1]
    assert not any(site.accepted for site in others)
    told = json.loads(json.dumps(build_report(result)))["fit"]
    assert told["model"] == "deformed"
    assert told["deformation"][0]["amount"] == pytest.approx(0.35, rel=0.2)


def make_scaled(folder: Path, scale: float) -> Path:
    """A job whose scan, with a dent, is scaled."""
    write_stl(folder / "plate.stl", get_part())
    points, normals = draw_skin(count=30_000)
    x, y, z = scale * add_noise(dent(points, normals, 2.5, 8.0)).T
    write_points(folder / "scan.ply", {"x": x, "y": y, "z": z})
    job = folder / "job.yaml"
    job.write_text(f"version: 1\ntolerance: {TOLERANCE}\nalign: none\nadapt: none\npart: plate.stl\nscan: scan.ply\n")
    return job


@pytest.mark.slow
def test_a_scale_is_corrected_on_request(tmp_path: Path) -> None:
    job = make_scaled(tmp_path, 1.005)
    named = damageest.run(job)
    assert named.fit is not None
    assert named.fit.model == "scaled"
    result = damageest.run(job, settings=["scan.scale=auto"])
    assert result.fit is not None
    assert result.fit.model == "ok"
    assert result.fit.corrected_scale == pytest.approx(1.005, abs=5e-4)
    assert any(note.code == "model_fit" for note in result.warnings)
    assert len(result.sites) == 1
    true = 2.5 * np.pi * 8.0**2 / 2
    assert result.damage_volume == pytest.approx(true, rel=0.03)
    # scan, pose and aligned scan agree
    T = result.pose.T_part_scan
    assert np.abs(result.scan.points @ T[:3, :3].T + T[:3, 3] - result.aligned.points).max() < 1e-6
    assert T[:3, :3] @ T[:3, :3].T == pytest.approx(np.eye(3), abs=1e-9)


def test_another_value_of_scale_is_refused(job_file: Callable[..., Path]) -> None:
    with pytest.raises(DamageestError, match=r"scale"):
        damageest.run(job_file(), settings=["scan.scale=1.01"])
