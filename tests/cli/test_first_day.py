"""What a new user meets on the first day: a new job, a folder instead of a job, a wrong setting, a run that fails."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from damageest.errors import StageError
from damageest.job import yamlfile
from damageest.output.skin_json import report_deviation
from damageest.pipeline.finding.fallback import drop_tried
from tests import damaged_box
from tests.cli.calls import call


def test_a_new_job_is_valid_and_names_schema_methods_and_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    damaged_box.write_least(tmp_path)
    monkeypatch.chdir(tmp_path)
    assert call("init", "box.stl", "scan.ply", "-o", "chip.yaml")[0] == 0
    text = Path("chip.yaml").read_text()
    assert text.startswith("# yaml-language-server: $schema=")
    assert all(word in text for word in ("implicit", "surface", "octree", "milling", "out/chip"))
    commented = [
        line[2:] for line in text.splitlines() if line[2:].startswith(("method", "allowance", "export", "output"))
    ]
    Path("all.yaml").write_text(text + "\n".join(commented))
    assert call("validate", "chip.yaml", "all.yaml")[0] == 0


def test_part_and_scan_swapped_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    damaged_box.write_least(tmp_path)
    monkeypatch.chdir(tmp_path)
    status, said = call("init", "scan.ply", "box.stl")
    assert status == 2
    assert "swapped" in said


def test_a_folder_is_no_job_and_its_jobs_are_listed(tmp_path: Path) -> None:
    damaged_box.write_least(tmp_path)
    status, said = call("run", tmp_path)
    assert status == 2
    assert "job.yaml" in said
    assert "is a folder" in said


@pytest.mark.parametrize(
    ("setting", "wrong"), [("export.format=dxf", "dxf"), ("tolerance=-1", "-1"), ("cluster.link=2", "link")]
)
def test_a_wrong_setting_is_named_and_not_a_line_of_the_file(setting: str, wrong: str, tmp_path: Path) -> None:
    job = damaged_box.write_least(tmp_path)
    status, said = call("validate", job, "--set", setting)
    assert status == 2
    assert said.startswith(f"--set {setting}: ")
    assert wrong in said.partition(": ")[2]
    assert "job.yaml" not in said


def test_a_run_that_fails_keeps_its_stages_and_leaves_nothing_else(tmp_path: Path) -> None:
    job = damaged_box.write_least(tmp_path)
    job.write_text(job.read_text().replace("align: none", "align: {use: none, T_part_scan: T}"))
    far = "[[1, 0, 0, 90], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
    job.write_text(job.read_text().replace("T}", f"{far}}}"))
    assert call("run", "-q", job)[0] == 1
    assert os.listdir(tmp_path / "out") == ["job"]
    assert os.listdir(tmp_path / "out/job") == ["stages"]
    assert {path.name.split("-")[0] for path in (tmp_path / "out/job/stages").iterdir()} >= {"part", "scan"}
    assert "no result.json" in call("view", tmp_path / "out/job")[1]


def test_aliases_that_expand_without_end_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "job.yaml"
    pairs = zip("abcdefgh", "bcdefghi", strict=True)
    path.write_text("a: &a [1]\n" + "".join(f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in pairs))
    status, said = call("validate", path)
    assert status == 2
    assert "aliases" in said


def test_an_alias_that_contains_itself_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "job.yaml"
    path.write_text("version: 1\npart: &p [*p]\n")
    assert "aliases" in call("validate", path)[1]


def test_aliases_of_usual_size_are_read() -> None:
    assert yamlfile.parse("a: &x [1, 2]\nb: *x\n", "text")[0] == {"a": [1, 2], "b": [1, 2]}


def test_a_pipe_is_no_job(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "job.yaml")
    assert "not a regular file" in call("validate", tmp_path / "job.yaml")[1]


@pytest.mark.parametrize(
    ("remedy", "left"), [("", "both methods were tried"), ("background: bbox", "background: bbox")]
)
def test_a_remedy_that_was_tried_is_not_given_again(remedy: str, left: str) -> None:
    error = StageError("x", remedy, method="implicit")
    assert error.remedy.endswith("method: implicit")
    said = drop_tried(error).remedy
    assert left in said
    assert "method: implicit" not in said


def test_counts_and_percentiles_are_those_of_the_points() -> None:
    import numpy as np

    from damageest.artefacts import Deviation

    distance = np.linspace(-1.0, 1.0, 201)
    label = np.where(distance < -0.5, 1, 0).astype(np.uint8)
    report = report_deviation(Deviation(distance, np.zeros(201, np.int64), label))
    assert report.labels.intact + report.labels.damage == 201
    assert report.labels.damage == (label == 1).sum()
    assert report.percentiles["50"] == pytest.approx(0.0)
    assert report.intact_percentiles["1"] >= -0.5
