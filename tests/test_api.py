"""`damageest.run` with a path, a mapping, and arrays."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import damageest
from damageest.errors import InputError, JobError
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest.stages.export.files import Files
from tests import damaged_box

LEAST = {"version": 1, "tolerance": 0.4, "align": "none"}


def write(folder: Path) -> Path:
    """A job of 2000 points, for whole runs in a second."""
    return damaged_box.write(folder, damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4"), 2000)


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("api"))


@pytest.fixture(scope="module")
def by_path(job: Path) -> Result:
    before = damaged_box.content(job.parent)
    result = damageest.run(job)
    assert damaged_box.content(job.parent) == before, "writes nothing unless asked"
    return result


def test_a_path_is_run(by_path: Result) -> None:
    assert len(by_path.sites) == 1
    assert by_path.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.1)
    assert by_path.sites[0].evidence.consistent
    assert by_path.sites[0].max_depth == pytest.approx(6, abs=0.3)
    assert by_path.sites[0].centroid[2] == pytest.approx(10 - 6 * 3 / 8, abs=0.3)


@pytest.mark.variants(1)
@pytest.mark.parametrize("way", ["mapping of paths", "mapping of objects", "arrays"])
def test_mapping_and_arrays_give_the_same_as_a_path(way: str, job: Path, by_path: Result) -> None:
    mesh = trimesh.creation.box(damaged_box.SIZE)
    points = by_path.scan.points
    match way:
        case "mapping of paths":
            part, scan = str(job.with_name("box.stl")), [str(job.with_name("scan.ply"))]
            result = damageest.run({**LEAST, "part": part, "scan": scan})
        case "mapping of objects":
            result = damageest.run({**LEAST, "part": mesh, "scan": points})
        case _:
            result = damageest.run(LEAST, part=(mesh.vertices, mesh.faces), scan=trimesh.PointCloud(points))
    assert len(result.sites) == 1
    assert result.damage_volume == pytest.approx(by_path.damage_volume, rel=1e-6)


@pytest.fixture(scope="module")
def written(job: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """The folder that a run was asked to write to, and its result."""
    folder = tmp_path_factory.mktemp("written") / "here"
    return folder, damageest.run(job, output=folder, cache=False)


def test_output_where_asked(written: tuple[Path, Result]) -> None:
    folder, result = written
    report = json.loads((folder / "result.json").read_text())
    assert report["damage_volume"] == result.damage_volume
    assert report["sites"][0]["files"]["damage"] == "damage/site-1.stl"
    again = trimesh.load(folder / "damage/site-1.stl")
    assert again.is_watertight
    assert again.volume == pytest.approx(result.damage_volume, rel=1e-4)


def test_the_same_job_gives_the_same_bytes(job: Path, written: tuple[Path, Result], tmp_path: Path) -> None:
    damageest.run(job, output=tmp_path / "again", cache=False)
    first, second = (damaged_box.content(folder) for folder in (written[0], tmp_path / "again"))
    assert first.keys() == second.keys()
    differing = {name for name in first if first[name] != second[name] and not name.endswith(".npz")}
    assert differing <= {"result.json"}
    reports = [json.loads(c["result.json"]) for c in (first, second)]
    for report in reports:
        report["steps"] = [step["step"] for step in report["steps"]]
        report["stages"] = [{k: v for k, v in s.items() if k not in ("seconds", "cached")} for s in report["stages"]]
    assert reports[0] == reports[1]


def test_no_damage_is_a_result(tmp_path: Path) -> None:
    points = trimesh.sample.sample_surface(trimesh.creation.box(damaged_box.SIZE), 2000, seed=1)[0]
    points = points + np.random.default_rng(2).normal(scale=0.04, size=points.shape)
    result = damageest.run(LEAST, part=trimesh.creation.box(damaged_box.SIZE), scan=points, output=tmp_path / "out")
    assert (result.status, result.sites, result.damage) == ("ok", (), None)
    assert not (tmp_path / "out/damage.stl").exists()
    assert (tmp_path / "out/result.json").exists()


@pytest.mark.parametrize(
    ("part", "scan", "error"),
    [
        (damaged_box.box(), np.empty((0, 3)), InputError),
        (damaged_box.box(), np.full((9, 3), np.nan), InputError),
        (damaged_box.box(), np.zeros((9, 2)), InputError),
        (7, np.zeros((9, 3)), InputError),
        (None, np.zeros((9, 3)), JobError),
    ],
)
def test_bad_arrays_are_refused(part: object, scan: np.ndarray, error: type[Exception]) -> None:
    with pytest.raises(error):
        damageest.run(LEAST, part=part, scan=scan)


@pytest.mark.slow
def test_what_export_warns_of_is_in_the_result(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the one that is given, and in the one that is written, both with all stages."""
    export = Files.run

    def run(self: Files, result: Result, folder: Path, writers: Any) -> ExportedFiles:
        return replace(export(self, result, folder, writers), warnings=("a file is coarse",))

    monkeypatch.setattr(Files, "run", run)
    result = damageest.run(write(tmp_path), output=tmp_path / "out")
    content = json.loads((tmp_path / "out/result.json").read_text())
    assert [note.text for note in result.warnings if note.code == "export"] == ["a file is coarse"]
    assert [note["text"] for note in content["warnings"] if note["code"] == "export"] == ["a file is coarse"]
    assert [one.stage for one in result.stages][-2:] == ["export", "report"]
    assert [one["stage"] for one in content["stages"]] == [one.stage for one in result.stages]
