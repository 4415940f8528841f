"""An E57 file with two poses: each scan is moved by its own, and is a view with a scanner position of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import damageest
from damageest.artefacts import Floats
from damageest.stages.scan.simulate import Simulate
from tests import damaged_box
from tests.stages.scan.test_file_views import write_e57

TURNS = Rotation.from_euler("zyx", [[100, 20, -30], [-60, 170, 10]], degrees=True)


def scan_views() -> tuple[Floats, Floats, Floats]:
    """Points, views and positions of two scanners above the damaged box, in millimetres."""
    tool = {"tool": "sphere", "centre": [0, 0, damaged_box.SIZE[2] / 2], "radius": 6}
    places = [[60, -90, 220], [-70, 60, 190]]
    scanner = Simulate.model_validate({"damage": [tool], "points": 9000, "noise": 0.04, "scanners": places})
    scan = scanner.run("mm", damaged_box.box())
    assert scan.view is not None
    assert scan.viewpoints is not None
    return scan.points, scan.view, scan.viewpoints


def write(path: Path, points: Floats, view: Any, places: Floats) -> None:
    """The points of each scanner in its own frame, in metres."""
    scans = []
    for number, (place, turn) in enumerate(zip(places, TURNS, strict=True)):
        own = turn.inv().apply(points[view == number] - place) / 1000
        x, y, z, w = turn.as_quat()
        scans.append((own, {"rotation": np.array([w, x, y, z]), "translation": place / 1000}))
    write_e57(path, *scans)


@pytest.mark.slow
@pytest.mark.parametrize("most_points", [0, pytest.param(6000, marks=pytest.mark.slow)])
def test_each_scan_has_its_pose_and_position(tmp_path: Path, most_points: int) -> None:
    """Read whole and in pieces."""
    points, view, places = scan_views()
    order = np.argsort(view, kind="stable")
    write(tmp_path / "a.e57", points, view, places)
    trimesh.creation.box(damaged_box.SIZE).export(tmp_path / "box.stl")
    job = {"version": 1, "tolerance": 0.3, "align": "none", "report": "none", "part": str(tmp_path / "box.stl")}
    job |= {"scan": {"path": str(tmp_path / "a.e57"), "most_points": most_points}}
    done = damageest.run(job)
    assert done.scan.viewpoints == pytest.approx(places, abs=1e-6)
    assert done.scan.view is not None
    if not most_points:
        assert done.scan.points == pytest.approx(points[order], abs=1e-4)
        assert (done.scan.view == view[order]).all()
    assert done.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.03)
    assert [site.verdict.level for site in done.sites] == ["proven"]
