"""The command line: what it prints, writes and refuses."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from damageest.cli import app
from damageest.findings import describe_volume, write_digits
from damageest.registry.contracts import STAGES
from tests import damaged_box
from tests.cli.calls import call as call_here
from tests.cli.conftest import Ran
from tests.needs import PLUGINS, import_or_skip, needs_plugin

ROOT = Path(__file__).parents[2]


def call(*words: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    code = "from damageest.cli import main; main()"
    return subprocess.run([sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, cwd=cwd)


def test_run_prints_a_table_and_writes_the_folder(command_run: Ran) -> None:
    assert "implicit" in command_run.stdout
    assert "likely" in command_run.stdout
    assert "the scan shows 100% of the skin" in command_run.stdout
    stages = [line.split(":")[0].strip() for line in command_run.stderr.splitlines() if ":" in line]
    assert stages[:2] == ["part", "scan"]
    written = {p.name for p in (command_run.folder / "out/job").iterdir()}
    assert {
        "result.json",
        "job.yaml",
        "damage.stl",
        "undamaged.stl",
        "damage",
        "deposit",
        "surface",
        "scan.ply",
        "skin.ply",
        "stages",
    } == written


@pytest.mark.slow
def test_the_job_that_a_run_writes_gives_the_same(least_done: Path, tmp_path: Path) -> None:
    done = tmp_path / "out/job"
    assert call_here("run", done / "job.yaml", "--output", tmp_path / "again", "--quiet") == (0, "")
    assert (tmp_path / "again/damage.stl").read_bytes() == (done / "damage.stl").read_bytes()


def test_the_table_says_what_to_deposit_and_what_to_mill_off(command_run: Ran) -> None:
    head, site = (line.split() for line in command_run.stdout.splitlines() if line.split()[:1] in (["site"], ["1"]))
    assert [word for word in head if word in ("volume", "deposit", "stock")] == ["volume", "deposit", "stock"]
    report = json.loads((command_run.folder / "out/job/result.json").read_text())["sites"][0]
    assert site[1] == describe_volume(report["volume"], report["volume_95"])
    assert float(site[1]) == pytest.approx(report["volume"], rel=0.001)
    assert site[4:6] == [write_digits(report["deposit"][name], 4) for name in ("volume", "stock_volume")]


def test_json_is_the_result_and_fits_its_schema(tmp_path: Path) -> None:
    jsonschema = import_or_skip("jsonschema")
    job = damaged_box.write_least(tmp_path)
    done = CliRunner().invoke(app, ["run", str(job), "--json", "--set", "method=implicit", "--no-cache"])
    report = json.loads(done.stdout)
    assert report == json.loads((tmp_path / "out/job/result.json").read_text())
    schema = json.loads((ROOT / "schemas/result.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(report)
    assert report["sites"][0]["volume"] == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)


def test_every_job_is_checked_before_the_first_runs(tmp_path: Path) -> None:
    good = damaged_box.write_least(tmp_path)
    bad = tmp_path / "bad.yaml"
    bad.write_text(damaged_box.JOB + "clutser: x\n")
    status, said = call_here("run", good, bad)
    assert status == 2
    assert f"{bad}:7:1" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_validate(tmp_path: Path) -> None:
    good = damaged_box.write_least(tmp_path)
    assert call_here("validate", good)[0] == 0
    good.write_text(damaged_box.JOB + "clutser: x\nsegment: y\n")
    done = call("validate", good)
    assert done.returncode == 2
    *faults, last = done.stderr.splitlines()
    assert [line.split(":")[1] for line in faults] == ["7", "8"]
    assert last == "help: damageest explain job; see docs/job-reference.md"
    assert done.stdout == ""


def write_new_job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(damaged_box.write_least(tmp_path).parent)
    status, said = call_here("init", "box.stl", "scan.ply", "--job", "new.yaml")
    assert status == 0, said


def test_init_writes_a_job_that_is_valid(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_new_job(tmp_path, monkeypatch)
    assert "noise 0.04" in (tmp_path / "new.yaml").read_text()
    assert call_here("validate", "new.yaml")[0] == 0


@pytest.mark.slow
def test_init_writes_a_job_that_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_new_job(tmp_path, monkeypatch)
    quick = ("--set", "tolerance=0.6", "--set", "align=none", "--set", "report=none")
    assert call_here("run", "new.yaml", *quick)[0] == 0


def test_init_replaces_no_job_that_is_there(tmp_path: Path) -> None:
    job = damaged_box.write_least(tmp_path)
    before = job.read_bytes()
    status, said = call_here("init", tmp_path / "box.stl", tmp_path / "scan.ply", "--job", job)
    assert status == 2
    assert "--force" in said
    assert job.read_bytes() == before


@pytest.mark.slow
def test_the_first_run_takes_what_init_read(tmp_path: Path) -> None:
    damaged_box.write(tmp_path)
    assert call("init", "box.stl", "scan.ply", "--job", "new.yaml", cwd=tmp_path).returncode == 0
    done = call("run", "new.yaml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    said = {line.split(":")[0].strip(): line for line in done.stderr.splitlines() if ":" in line}
    assert all("from an earlier run" in said[stage] for stage in ("part", "scan"))
    with (tmp_path / "scan.ply").open("ab") as stream:
        stream.write(b"\n")  # another file: it is read again
    again = call("run", "new.yaml", "-o", "other", cwd=tmp_path)
    assert "from an earlier run" not in again.stderr
    mine = tmp_path / "out/kept"
    mine.mkdir()
    (mine / "notes.txt").write_text("mine")
    assert call("init", "box.stl", "scan.ply", "--job", "kept.yaml", cwd=tmp_path).returncode == 0
    assert [path.name for path in mine.iterdir()] == ["notes.txt"]


def test_stages_lists_everything_and_each_option() -> None:
    listed = call_here("stages")[1]
    assert all(f"\n{stage}\n" in f"\n{listed}" for stage in STAGES)
    shown = call_here("stages", "cluster", "dbscan")[1]
    assert "neighbours" in shown
    assert "default 10" in shown
    assert "did you mean 'cluster'?" in call_here("stages", "clutser")[1]


@needs_plugin(*PLUGINS)
def test_the_schema_of_jobs() -> None:
    assert json.loads(call_here("schema")[1]) == json.loads((ROOT / "schemas/job.schema.json").read_text())


def test_plugins_and_the_schema_of_results() -> None:
    assert "damageest-cadquery" in call_here("plugins")[1]
    assert json.loads(call_here("schema", "result")[1])["title"] == "damageest result"


def test_debug_shows_where_an_error_came_from(tmp_path: Path) -> None:
    path = damaged_box.write_least(tmp_path)
    (tmp_path / "box.stl").write_bytes(b"nonsense")
    assert "Traceback" not in call_here("run", path)[1]
    assert "Traceback" in call_here("run", path, "--debug")[1]


def list_meshes(folder: Path) -> dict[str, bytes]:
    found = {name: data for name, data in damaged_box.content(folder).items() if Path(name).suffix in (".stl", ".ply")}
    assert len(found) > 3
    return found


@pytest.mark.slow
def test_another_number_of_threads_gives_the_same_bytes(least_done: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMP_NUM_THREADS", "IGL_NUM_THREADS"):
        monkeypatch.setenv(name, "1")  # the option sets them
    out = least_done.parent / "out-5"
    assert call_here("run", least_done, "--threads", "5", "--no-cache", "-q", "-o", out) == (0, "")
    assert list_meshes(out) == list_meshes(least_done.parent / "out/job")
    assert call_here("run", least_done, "--threads", "many")[0] == 2


@pytest.mark.slow
def test_any_number_of_threads_gives_the_same_bytes(tmp_path: Path) -> None:
    job, found = damaged_box.write(tmp_path), []
    for threads in (1, 2, 5):
        done = call("run", job, "--threads", threads, "--no-cache", "-o", tmp_path / f"out-{threads}")
        assert done.returncode == 0, done.stderr
        found.append(list_meshes(tmp_path / f"out-{threads}"))
    assert found[0] == found[1] == found[2]
