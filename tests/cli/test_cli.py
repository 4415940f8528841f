"""The command line, called in a process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from damageest.registry.contracts import STAGES
from tests import damaged_box
from tests.needs import PLUGINS, import_or_skip, needs_plugin

ROOT = Path(__file__).parents[2]


def call(*words: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    code = "from damageest.cli import main; main()"
    return subprocess.run([sys.executable, "-c", code, *map(str, words)], capture_output=True, text=True, cwd=cwd)


def test_run_prints_a_table_and_writes_the_folder(tmp_path: Path) -> None:
    done = call("run", damaged_box.write(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "implicit" in done.stdout
    assert "proven" in done.stdout
    assert "the scan shows 100% of the skin" in done.stdout
    stages = [line.split(":")[0].strip() for line in done.stderr.splitlines() if ":" in line]
    assert stages[:2] == ["part", "scan"]
    written = {p.name for p in (tmp_path / "out/job").iterdir()}
    assert {
        "result.json",
        "job.yaml",
        "damage.stl",
        "undamaged.stl",
        "damage",
        "surface",
        "scan.ply",
        "skin.ply",
        "stages",
    } == written
    again = call("run", tmp_path / "out/job/job.yaml", "--output", tmp_path / "again", "--quiet")
    assert (again.returncode, again.stdout, again.stderr) == (0, "", "")
    assert (tmp_path / "again/damage.stl").read_bytes() == (tmp_path / "out/job/damage.stl").read_bytes()


def test_the_table_says_what_to_deposit_and_what_to_mill_off(tmp_path: Path) -> None:
    stock = "allowance: {use: milling, outer: 1, inner: 0.5}\n"
    done = call("run", damaged_box.write(tmp_path, damaged_box.JOB + stock))
    assert done.returncode == 0, done.stderr
    head, site = (line.split() for line in done.stdout.splitlines() if line.split()[:1] in (["site"], ["1"]))
    assert [word for word in head if word in ("volume", "deposit", "stock")] == ["volume", "deposit", "stock"]
    report = json.loads((tmp_path / "out/job/result.json").read_text())["sites"][0]
    assert site[1] == f"{report['volume']:.6g}"
    assert site[4:6] == [f"{report['deposit']['volume']:.6g}", f"{report['deposit']['stock_volume']:.6g}"]


def test_json_is_the_result_and_fits_its_schema(tmp_path: Path) -> None:
    jsonschema = import_or_skip("jsonschema")
    done = call("run", damaged_box.write(tmp_path), "--json", "--set", "method=implicit", "--no-cache")
    report = json.loads(done.stdout)
    assert report == json.loads((tmp_path / "out/job/result.json").read_text())
    schema = json.loads((ROOT / "schemas/result.schema.json").read_text())
    jsonschema.Draft202012Validator(schema).validate(report)
    assert report["sites"][0]["volume"] == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.02)


def test_every_job_is_checked_before_the_first_runs(tmp_path: Path) -> None:
    good = damaged_box.write(tmp_path)
    bad = tmp_path / "bad.yaml"
    bad.write_text(damaged_box.JOB + "clutser: x\n")
    done = call("run", good, bad)
    assert done.returncode == 2
    assert f"{bad}:7:1" in done.stderr
    assert not (tmp_path / "out").exists()


def test_validate(tmp_path: Path) -> None:
    good = damaged_box.write(tmp_path)
    assert call("validate", good).returncode == 0
    good.write_text(damaged_box.JOB + "clutser: x\nsegment: y\n")
    done = call("validate", good)
    assert done.returncode == 2
    *faults, last = done.stderr.splitlines()
    assert [line.split(":")[1] for line in faults] == ["7", "8"]
    assert last == "help: damageest explain job; see docs/job-reference.md"
    assert done.stdout == ""


def test_init_writes_a_job_that_runs(tmp_path: Path) -> None:
    damaged_box.write(tmp_path)
    done = call("init", "box.stl", "scan.ply", "--job", "new.yaml", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "noise 0.04" in (tmp_path / "new.yaml").read_text()
    assert call("run", "new.yaml", cwd=tmp_path).returncode == 0
    refused = call("init", "box.stl", "scan.ply", "--job", "new.yaml", cwd=tmp_path)
    assert refused.returncode == 2
    assert "--force" in refused.stderr


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
    listed = call("stages").stdout
    assert all(f"\n{stage}\n" in f"\n{listed}" for stage in STAGES)
    shown = call("stages", "cluster", "dbscan").stdout
    assert "neighbours" in shown
    assert "default 10" in shown
    assert "did you mean 'cluster'?" in call("stages", "clutser").stderr


@needs_plugin(*PLUGINS)
def test_the_schema_of_jobs() -> None:
    assert json.loads(call("schema").stdout) == json.loads((ROOT / "schemas/job.schema.json").read_text())


def test_plugins_and_the_schema_of_results() -> None:
    assert "damageest-cadquery" in call("plugins").stdout
    assert json.loads(call("schema", "result").stdout)["title"] == "damageest result"


def test_debug_shows_where_an_error_came_from(tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path)
    (tmp_path / "box.stl").write_bytes(b"nonsense")
    assert "Traceback" not in call("run", path).stderr
    assert "Traceback" in call("run", path, "--debug").stderr


def test_any_number_of_threads_gives_the_same_bytes(tmp_path: Path) -> None:
    job, found = damaged_box.write(tmp_path), []
    for threads in (1, 2, 5):
        done = call("run", job, "--threads", threads, "--no-cache", "-o", tmp_path / f"out-{threads}")
        assert done.returncode == 0, done.stderr
        folder = tmp_path / f"out-{threads}"
        files = [path for kind in ("*.stl", "*.ply") for path in sorted(folder.rglob(kind))]
        assert len(files) > 3
        found.append({str(path.relative_to(folder)): path.read_bytes() for path in files})
    assert found[0] == found[1] == found[2]
    assert call("run", job, "--threads", "many").returncode == 2
