"""A full disk, a folder that cannot be written, files that vanish, odd names, a clock that jumps: the earlier output
stays, and what went wrong is said."""

from __future__ import annotations

import json
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from typer.testing import CliRunner

import damageest
from damageest.cli import app
from damageest.errors import DamageestError, InputError, JobError
from damageest.registry import Registry
from damageest.registry.hookspecs import hookimpl
from tests import damaged_box
from tests.faults.kill import APP, COMMANDS, stop_runs, strip
from tests.pipeline.outputs import files, make

SLOW = pytest.mark.slow


@contextmanager
def limit_files(kilobytes: int) -> Iterator[None]:
    """This process may write files of this size at most, which stands for the space that is left."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (kilobytes * 1000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.variants(1)
@pytest.mark.parametrize("kilobytes", [0, 8, pytest.param(100, marks=SLOW), pytest.param(140, marks=SLOW)])
def test_a_full_disk(kilobytes: int, small_done: Path) -> None:
    out = small_done.parent / "out"
    before = damaged_box.content(out / "job")
    with limit_files(kilobytes):
        done = CliRunner().invoke(app, ["run", str(small_done), "--no-cache", "--quiet"])
    assert done.exit_code == 2, done.stderr
    assert "cannot be written: File too large" in done.stderr
    assert len(done.stderr.splitlines()) <= 3
    after = damaged_box.content(out / "job")
    assert {name: after.get(name) for name in before if not name.startswith("stages/")} == {
        name: data for name, data in before.items() if not name.startswith("stages/")
    }
    damageest.run(small_done, output=True)
    assert [one.name for one in out.iterdir()] == ["job"], "nothing is left lying about"


@pytest.mark.parametrize("output", ["box.stl/x", "/proc/x", "/dev/null/x", "a" * 300, "box.stl"])
def test_an_output_that_cannot_be_written(output: str, tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path, points=60)
    before = damaged_box.content(tmp_path)
    with pytest.raises(JobError, match=r"cannot be written|is a file"):
        damageest.run(path, output=tmp_path / output)
    assert damaged_box.content(tmp_path) == before


class Trouble:
    """Does something when a stage begins."""

    def __init__(self, stage: str, act: Any) -> None:
        self.stage, self.act = stage, act

    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        if stage == self.stage:
            self.act()


def test_a_file_that_vanishes(small_done: Path) -> None:
    """As on a network drive that is lost after the job was checked."""
    out, scan = small_done.parent / "out/job", small_done.parent / "scan.ply"
    before = strip(out)
    registry = Registry.discover([Trouble("scan", scan.unlink)])
    with pytest.raises(InputError, match=r"scan\.ply: there is no such file"):
        damageest.run(small_done, output=True, registry=registry, cache=False)
    assert strip(out) == before


@pytest.mark.slow
def test_an_output_folder_that_vanishes(small_done: Path) -> None:
    out = small_done.parent / "out"
    registry = Registry.discover([Trouble("export", lambda: shutil.rmtree(out))])
    with pytest.raises(DamageestError, match="cannot be written"):
        damageest.run(small_done, output=True, registry=registry)
    make(out / "job", "another")
    assert files(out / "job")["damage.stl"] == "another", "and another run finds the place in order"


@pytest.mark.slow
def test_a_clock_that_jumps(small_done: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = strip(small_done.parent / "out/job")
    jumps = iter(np.random.default_rng(0).uniform(0, 4e9, 1_000_000).tolist())
    monkeypatch.setattr(time, "time", lambda: next(jumps))
    damageest.run(small_done, output=True, cache=False)
    assert strip(small_done.parent / "out/job") == before


ODD = ["a\nb", "ñ 零件 قطعة", "'\"$(x)`;&| %s{}*?[a]", "a b", "-rf", "…\u202e"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["-" + "".join(ODD), *(pytest.param(name, marks=SLOW) for name in ODD)])
def test_odd_names(name: str, tmp_path: Path) -> None:
    """Of the folder, the files, the job and the output."""
    folder = tmp_path / name
    damaged_box.write(folder, points=1200)
    (folder / "box.stl").rename(folder / f"{name}.stl")
    (folder / "scan.ply").rename(folder / f"{name}.ply")
    job = {"version": 1, "name": name, "tolerance": 0.6, "align": "none", "report": "none"}
    path = folder / f"{name}.yaml"
    path.write_text(json.dumps({**job, "part": f"{name}.stl", "scan": f"{name}.ply"}))
    result = damageest.run(path, output=True)
    assert len(result.sites) == 1
    content = json.loads((folder / "out" / name / "result.json").read_text())
    assert content["name"] == name
    assert (folder / "out" / name / content["part"]["path"]).is_file()
    out = folder / "out" / name
    again = damageest.run(out / "job.yaml", output=out)
    assert again.damage_volume == result.damage_volume, "the job as it ran can be run again"
    assert [one.name for one in tmp_path.iterdir()] == [name], "nothing is written elsewhere"


@pytest.mark.parametrize(
    ("count", "commands"),
    [
        pytest.param(3, ("run",), marks=SLOW),
        pytest.param(60, COMMANDS, marks=[pytest.mark.nightly, pytest.mark.timeout(3000)]),
    ],
)
def test_stopped_at_random_moments(count: int, commands: tuple[str, ...]) -> None:
    """Runs end by signals or for want of memory: one of the two results is whole, and the next run gives the second."""
    trials = stop_runs(count, 0, commands, ("kill", "int", "memory"))
    assert not [trial for trial in trials if trial.faults]
    assert sum(trial.hit for trial in trials) >= count / 2


@pytest.mark.slow
def test_a_run_of_the_app_ends_with_the_app(tmp_path: Path) -> None:
    """However the app ends: else its run goes on unseen, and the next one is refused."""
    damaged_box.write_small(tmp_path)
    running = subprocess.Popen([sys.executable, "-c", APP, "run", "job.yaml", "--no-cache"], cwd=tmp_path)
    while not (tmp_path / "out/.job.partial/stages").is_dir():  # it has begun
        time.sleep(0.02)
        assert running.poll() is None
    family = psutil.Process(running.pid).children(recursive=True)
    assert family
    running.kill()
    running.wait()
    assert not psutil.wait_procs(family, timeout=20)[1]
    assert not (tmp_path / "out/job").exists()
