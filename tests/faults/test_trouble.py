"""A full disk, a folder that cannot be written, files that vanish, odd names, a clock that jumps: the earlier output
stays, and what went wrong is said."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.errors import DamageestError, InputError, JobError
from damageest.registry import Registry
from damageest.registry.hookspecs import hookimpl
from tests import damaged_box


def strip(folder: Path) -> dict[str, bytes]:
    """The content of an output folder, without the seconds that each stage took and without the kept stages."""
    found = {name: data for name, data in damaged_box.content(folder).items() if not name.startswith("stages/")}
    content = json.loads(found.pop("result.json"))
    content.pop("stages")
    found["result.json"] = json.dumps(content).encode()
    return found


@pytest.mark.parametrize("kilobytes", [0, 8, 300, 900])
def test_a_full_disk(kilobytes: int, tmp_path: Path) -> None:
    """The largest file that the process may write stands for the space that is left."""
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True)
    before = damaged_box.content(tmp_path / "out/job")
    done = subprocess.run(
        [sys.executable, "-c", "from damageest.cli import main; main()", "run", str(path), "--no-cache", "--quiet"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (kilobytes * 1000,) * 2),
    )
    assert done.returncode == 2, done.stderr
    assert "cannot be written: File too large" in done.stderr
    assert len(done.stderr.splitlines()) <= 3
    after = damaged_box.content(tmp_path / "out/job")
    assert {name: after.get(name) for name in before if not name.startswith("stages/")} == {
        name: data for name, data in before.items() if not name.startswith("stages/")
    }
    damageest.run(path, output=True)
    assert [one.name for one in (tmp_path / "out").iterdir()] == ["job"], "nothing is left lying about"


@pytest.mark.parametrize("output", ["box.stl/x", "/proc/x", "/dev/null/x", "a" * 300, "box.stl"])
def test_an_output_that_cannot_be_written(output: str, tmp_path: Path) -> None:
    path = damaged_box.write(tmp_path)
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


def test_a_file_that_vanishes(tmp_path: Path) -> None:
    """As on a network drive that is lost after the job was checked."""
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True)
    before = strip(tmp_path / "out/job")
    registry = Registry.discover([Trouble("scan", (tmp_path / "scan.ply").unlink)])
    with pytest.raises(InputError, match=r"scan\.ply: there is no such file"):
        damageest.run(path, output=True, registry=registry, cache=False)
    assert strip(tmp_path / "out/job") == before


def test_an_output_folder_that_vanishes(tmp_path: Path) -> None:
    import shutil

    path = damaged_box.write(tmp_path)
    registry = Registry.discover([Trouble("export", lambda: shutil.rmtree(tmp_path / "out"))])
    with pytest.raises(DamageestError, match="cannot be written"):
        damageest.run(path, output=True, registry=registry)
    damageest.run(path, output=True)


def test_a_clock_that_jumps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = damaged_box.write(tmp_path)
    damageest.run(path, output=True, cache=False)
    before = strip(tmp_path / "out/job")
    jumps = iter(np.random.default_rng(0).uniform(0, 4e9, 1_000_000).tolist())
    monkeypatch.setattr(time, "time", lambda: next(jumps))
    damageest.run(path, output=True, cache=False)
    assert strip(tmp_path / "out/job") == before


@pytest.mark.parametrize("name", ["a b", "a\nb", "ñ 零件 قطعة", "-rf", "'\"$(x)`;&|", "%s{}*?[a]", "…\u202e"])
def test_odd_names(name: str, tmp_path: Path) -> None:
    """Of the folder, the files, the job and the output."""
    folder = tmp_path / name
    damaged_box.write(folder)
    (folder / "box.stl").rename(folder / f"{name}.stl")
    (folder / "scan.ply").rename(folder / f"{name}.ply")
    job = {"version": 1, "name": name, "tolerance": 0.5, "align": "none", "report": "none"}
    path = folder / f"{name}.yaml"
    path.write_text(json.dumps({**job, "part": f"{name}.stl", "scan": f"{name}.ply"}))
    result = damageest.run(path, output=True)
    assert len(result.sites) == 1
    content = json.loads((folder / "out" / name / "result.json").read_text())
    assert content["name"] == name
    assert (folder / "out" / name / content["part"]["path"]).is_file()
    again = damageest.run(folder / "out" / name / "job.yaml")
    assert again.damage_volume == result.damage_volume, "the job as it ran can be run again"
    assert [one.name for one in tmp_path.iterdir()] == [name], "nothing is written elsewhere"


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_killed_at_random_moments(tmp_path: Path) -> None:
    """100 runs end by SIGKILL at any moment: the earlier output is whole, and the next run gives the same bytes."""
    path = damaged_box.write(tmp_path, damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4"))
    start = time.monotonic()
    damageest.run(path, output=True, cache=False)
    length = time.monotonic() - start
    out = tmp_path / "out/job"
    right = strip(out)
    rng = np.random.default_rng(0)
    killed = 0
    script = (
        "import sys, damageest; from damageest.registry import Registry; import scipy.spatial, pyvista, igl, trimesh\n"
        "registry = Registry.discover(); print('ready', flush=True)\n"
        "damageest.run(sys.argv[1], output=True, cache=False, registry=registry)"
    )
    for moment in rng.uniform(0, 1.1 * length, 100):
        child = subprocess.Popen([sys.executable, "-c", script, str(path)], stdout=subprocess.PIPE)
        assert child.stdout
        child.stdout.readline()
        time.sleep(moment)
        child.send_signal(signal.SIGKILL)
        killed += child.wait() == -signal.SIGKILL
        child.stdout.close()
        held = out if out.is_dir() else tmp_path / "out/.job.old"  # between two renames
        assert strip(held) == right
        damageest.run(path, output=True)
        assert strip(out) == right
        assert [one.name for one in (tmp_path / "out").iterdir()] == ["job"]
    assert killed > 60
