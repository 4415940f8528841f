"""`damageest verify`: what changed after the run is named, and a repeated run gives the same."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.output.provenance import list_packages
from tests import damaged_box


@pytest.fixture
def home(least_job: Path, tmp_path: Path) -> Path:
    shutil.copytree(least_job, tmp_path / "home")
    return tmp_path / "home"


def verify(home: Path, *options: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["verify", str(home / "out/job"), *options])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, " ".join(result.output.split())


def test_an_output_as_the_run_left_it(home: Path) -> None:
    status, said = verify(home)
    assert status == 0, said
    assert "are as the run left them" in said
    (home / "out/job/notes.txt").write_text("mine")
    assert verify(home)[0] == 0, "files of the user are none of the result's"


@pytest.mark.slow
def test_every_file_and_input_is_watched(home: Path) -> None:
    content = json.loads((home / "out/job/result.json").read_text())
    outputs = [item["path"] for item in content["provenance"]["outputs"]]
    assert {"damage.stl", "scan.ply", "job.yaml", "surface/site-1.ply"} <= set(outputs)
    assert set(content["export"]["files"]) <= set(outputs)
    watched = [home / "out/job" / name for name in outputs] + [home / "box.stl", home / "scan.ply"]
    for path in watched:
        data = path.read_bytes()
        path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
        status, said = verify(home)
        assert status == 1
        assert f"{path.name}: was changed after the run" in said
        path.unlink()
        assert f"{path.name}: cannot be read" in verify(home)[1]
        path.write_bytes(data)
    assert verify(home)[0] == 0


def test_a_changed_number_in_the_result_is_noticed(home: Path) -> None:
    path = home / "out/job/result.json"
    content = json.loads(path.read_text())
    content["damage_volume"] *= 1.01
    path.write_text(json.dumps(content))
    assert "result.json: was changed" in verify(home)[1]


@pytest.mark.slow
def test_a_repeated_run_gives_the_same(home: Path) -> None:
    """From result.json alone: without job files, kept stages and in another folder."""
    (home / "job.yaml").unlink()
    (home / "out/job/job.yaml").unlink()
    shutil.rmtree(home / "out/job/stages")
    before = sorted(path.name for path in home.rglob("*"))
    status, said = verify(home, "--rerun")
    assert "a repeated run gives the same" in said
    assert status == 1, "the job file is missing"
    assert sorted(path.name for path in home.rglob("*")) == before


@pytest.mark.slow
def test_a_repeated_run_that_differs_says_where(home: Path) -> None:
    scan = (home / "scan.ply").read_bytes()
    head, body = scan.split(b"end_header\n", 1)
    points = np.frombuffer(body, "<f8").reshape(-1, 3).copy()
    points[np.linalg.norm(points - (0, 0, 10), axis=1) < 7, 2] -= 0.5
    (home / "scan.ply").write_bytes(head + b"end_header\n" + points.tobytes())
    status, said = verify(home, "--rerun")
    assert status == 1
    assert "scan.ply: was changed after the run" in said
    assert "damage_volume: was" in said
    assert "damage.stl: differs in the repeated run" in said


def test_the_result_says_what_it_was_made_with(home: Path) -> None:
    provenance = json.loads((home / "out/job/result.json").read_text())["provenance"]
    assert {"damageest", "numpy", "manifold3d", "libigl"} <= set(provenance["packages"])
    assert provenance["packages"] == list_packages(["damageest"])
    assert provenance["job"]["align"] == {"use": "none", "T_part_scan": None}
    assert len(provenance["sources"]["damageest"]) == 64
    assert "Python 3." in provenance["system"]


@pytest.mark.slow
def test_arrays_are_hashed_and_cannot_be_read_again(tmp_path: Path) -> None:
    job = {"version": 1, "tolerance": 0.4, "align": "none", "report": "none"}
    box = damaged_box.box()
    for number, points in enumerate((damaged_box.scan(), damaged_box.scan(), damaged_box.scan() + 1e-9)):
        damageest.run(job, part=box, scan=points, output=tmp_path / f"out/{number}")
    given = [
        json.loads((tmp_path / f"out/{number}/result.json").read_text())["provenance"]["given"] for number in range(3)
    ]
    assert given[0] == given[1] != given[2]
    (tmp_path / "out/0").rename(tmp_path / "out/job")
    result = CliRunner().invoke(app, ["verify", str(tmp_path / "out/job"), "--rerun"])
    assert "part and scan were arrays" in str(result.exception)
