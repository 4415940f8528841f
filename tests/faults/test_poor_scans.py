"""Scans with next to nothing on them, and with points far away: what they say, and no more."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from damageest.cli import app
from damageest.io.meshes import write_points
from tests import damaged_box

RNG = np.random.default_rng(0)
INTACT = damaged_box.scan(6000)[damaged_box.scan(6000)[:, 2] < 9.5]
LINE = np.column_stack([np.linspace(-15, 15, 300), np.zeros(300), np.full(300, -10.0)])
PLANE = np.column_stack([RNG.uniform(-19, 19, 900), RNG.uniform(-14, 14, 900), np.full(900, -10.0)])
POOR = {
    "1 point": INTACT[:1],
    "15 points": INTACT[:: len(INTACT) // 15][:15],
    "50 points": INTACT[:: len(INTACT) // 50][:50],
    "50 equal points": np.repeat(INTACT[:1], 50, axis=0),
    "a line": LINE,
    "a plane": PLANE,
}


def write(folder: Path, points: np.ndarray, job: str) -> Path:
    path = damaged_box.write(folder, job, 60)
    x, y, z = points.T
    write_points(folder / "scan.ply", {"x": x, "y": y, "z": z})
    return path


SLOW = pytest.mark.slow
KINDS = [(name, "0.2") for name in POOR] + [pytest.param(name, "auto", marks=SLOW) for name in POOR]


@pytest.mark.parametrize(("name", "tolerance"), KINDS)
def test_no_damage_is_found_in_next_to_nothing(name: str, tolerance: str, tmp_path: Path) -> None:
    job = damaged_box.JOB.replace("tolerance: 0.2", f"tolerance: {tolerance}")
    done = CliRunner().invoke(app, ["run", str(write(tmp_path, POOR[name], job))])
    assert done.exit_code == 0, (done.output, done.exception)
    assert "no damage deeper than" in done.stdout
    if len(np.unique(POOR[name], axis=0)) < 100:
        assert "too few to show the skin" in done.stdout
    seen = json.loads((tmp_path / "out/job/result.json").read_text())["coverage"]["seen"]
    assert seen < 0.6, "and it says that it saw little"
    assert "that the scan shows" in done.stdout


@pytest.mark.parametrize("align", ["none", pytest.param("register", marks=SLOW)])
def test_far_points_are_set_aside_counted_and_said(align: str, tmp_path: Path) -> None:
    """Twenty points a thousand diagonals away change nothing of what is found."""
    job = damaged_box.JOB.replace("align: none", f"align: {align}").replace("0.2", "0.4")
    points = damaged_box.scan(6000)
    direction = RNG.normal(size=(20, 3))
    far = 1000 * 54 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    volumes = []
    for scan in (points, np.vstack([points[:2000], far, points[2000:]])):
        done = CliRunner().invoke(app, ["run", str(write(tmp_path, scan, job))])
        assert done.exit_code == 0, (done.output, done.exception)
        content = json.loads((tmp_path / "out/job/result.json").read_text())
        volumes.append(content["damage_volume"])
        assert content["scan"]["points"] == len(points)
    assert volumes[0] == volumes[1]
    assert [note["amount"] for note in content["warnings"] if note["code"] == "far_points"] == [20]
    assert "20 scan points were set aside" in " ".join(done.stdout.split())
