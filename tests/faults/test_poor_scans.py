"""Scans with next to nothing on them, and with points far away: what they say, and no more."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.io.meshes import write_points
from damageest.result import Result
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


@pytest.mark.variants(3)
@pytest.mark.parametrize(("name", "tolerance"), KINDS)
def test_no_damage_is_found_in_next_to_nothing(name: str, tolerance: str, tmp_path: Path) -> None:
    job = damaged_box.JOB.replace("tolerance: 0.2", f"tolerance: {tolerance}")
    done = CliRunner().invoke(app, ["run", str(write(tmp_path, POOR[name], job))])
    assert done.exit_code == 0, (done.output, done.exception)
    assert "no damage deeper than" in done.stdout
    if len(np.unique(POOR[name], axis=0)) < 100:
        assert "damage between them stays hidden" in done.stdout
    seen = json.loads((tmp_path / "out/job/result.json").read_text())["coverage"]["seen"]
    assert seen < 0.6, "and it says that it saw little"
    assert "that the scan shows" in done.stdout


DIRECTION = RNG.normal(size=(20, 3))
FAR = 1000 * 54 * DIRECTION / np.linalg.norm(DIRECTION, axis=1, keepdims=True)
"""Twenty points a thousand diagonals away."""


def run_with_far_points(path: Path) -> tuple[float, list[int]]:
    """The damage volume of the job with them in its scan of 6000 points, and how many were told as far."""
    points = damaged_box.scan(6000)
    x, y, z = np.vstack([points[:2000], FAR, points[2000:]]).T
    write_points(path.parent / "scan.ply", {"x": x, "y": y, "z": z})
    done = CliRunner().invoke(app, ["run", str(path)])
    assert done.exit_code == 0, (done.output, done.exception)
    assert "20 stray scan points were removed" in " ".join(done.stdout.split())
    content = json.loads((path.parent / "out/job/result.json").read_text())
    assert content["scan"]["points"] == len(points)
    return content["damage_volume"], [n["amount"] for n in content["warnings"] if n["code"] == "far_points"]


@pytest.mark.slow
def test_far_points_are_set_aside_counted_and_said(small_done: Path, small_result: Result) -> None:
    """They change nothing of what is found."""
    assert run_with_far_points(small_done) == (small_result.damage_volume, [20])


@pytest.mark.slow
def test_far_points_are_set_aside_before_the_scan_is_aligned(tmp_path: Path) -> None:
    path = damaged_box.write_small(tmp_path)
    path.write_text(path.read_text().replace("align: none", "align: register"))
    without = damageest.run(path).damage_volume
    assert run_with_far_points(path) == (without, [20])
