"""Plugins whose stages give what cannot be right, raise what would end more than the stage, say too much, or leave
threads: whole runs, by the API, the command line and a batch."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

import damageest
from damageest.batches.work import work
from damageest.cli import app
from damageest.errors import MOST_TEXT, StageError
from damageest.registry import Registry
from tests import damaged_box
from tests.registry.conftest import TINY
from tests.registry.test_registry import Site, site

__all__ = ["site"]
STAGES = '''
from dataclasses import replace
import numpy as np
from damageest.artefacts import Deviation, Part, Pose, Reason, Samples, Scan, Sites
from damageest.errors import StageError
from damageest.stages.align import Align
from damageest.stages.cluster import Cluster
from damageest.stages.cluster.dbscan import Dbscan
from damageest.stages.segment import Segment
from damageest.stages.segment.mesh_distance import MeshDistance

class Posed(Align):
    """Does what its option says."""
    use: Literal["acme"] = "acme"
    do: str = ""
    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        T = np.eye(4)
        scope = {"T": T, "Pose": Pose, "Reason": Reason, "np": np, "StageError": StageError}
        scope["given"] = Pose(T, 0.04, 0.9)
        exec(self.do, scope)
        return scope["given"]

class Labelled(Segment):
    """Does what its option says."""
    use: Literal["acme"] = "acme"
    do: str = ""
    def run(self, aligned: Scan, part: Part, samples: Samples, tolerance: float) -> Deviation:
        given = MeshDistance().run(aligned=aligned, part=part, tolerance=tolerance)
        scope = {"given": given, "replace": replace, "np": np, "part": part}
        exec(self.do, scope)
        return scope["given"]

class Grouped(Cluster):
    """Does what its option says."""
    use: Literal["acme"] = "acme"
    do: str = ""
    def run(self, aligned: Scan, deviation: Deviation, tolerance: float) -> Sites:
        given = Dbscan().run(aligned, deviation, tolerance)
        scope = {"given": given, "Sites": Sites, "np": np}
        exec(self.do, scope)
        return scope["given"]

@hookimpl
def damageest_stages():
    return [Posed, Labelled, Grouped]
'''
FAULTS = {
    "labels that are none": ("segment", "given = replace(given, label=given.label + 7)", "label: index outside"),
    "labels wrapped": (
        "segment",
        "given = replace(given, label=given.label.astype(int) + 256)",
        "label: expected uint8",
    ),
    "label outlier": ("segment", "given = replace(given, label=np.full_like(given.label, 3))", "labels that segment"),
    "rows missing": (
        "segment",
        "given = replace(given, **{n: getattr(given, n)[:-5] for n in ('distance', 'face', 'label')})",
        "one for each scan point",
    ),
    "one row missing": ("segment", "given = replace(given, label=given.label[:-1])", "label: expected"),
    "face out of range": ("segment", "given = replace(given, face=given.face + 12)", "the 12 triangles of the part"),
    "distance NaN": ("segment", "given = replace(given, distance=given.distance * np.nan)", "not finite numbers"),
    "count 0": ("cluster", "given = Sites(given.label, 0)", "label: expected 0 to 0, the count of sites"),
    "count -1": ("cluster", "given = Sites(given.label, -1)", "count: expected a number of at least 0, got -1"),
    "sites of others": ("cluster", "given = Sites(given.label[:-9], given.count)", "one for each scan point"),
    "scale": ("align", "T[:3, :3] *= 1.002", "T_part_scan: not rigid"),
    "mirror": ("align", "T[0, 0] = -1", "mirrors"),
    "last row": ("align", "T[3, 3] = 2", "the last row of a pose"),
    "rms NaN": ("align", "given = Pose(T, np.nan)", "rms: expected a number of at least 0, got nan"),
    "rms negative": ("align", "given = Pose(T, -1.0)", "rms: expected a number of at least 0"),
    "inliers": ("align", "given = Pose(T, 0.1, 1.5)", "inliers: expected a number from 0 to 1, got 1.5"),
    "3x3": ("align", "given = Pose(np.eye(3))", "T_part_scan: expected (4,4), got (3, 3)"),
    "pose NaN": ("align", "given = Pose(T * np.nan)", "T_part_scan: 16 of 16 are not finite"),
    "alternatives": ("align", "given = Pose(T, alternatives=2 * T[None])", "alternatives: the last row"),
}


NO_DAMAGE = "cluster: {use: acme, do: 'given = Sites(0 * given.label, 0)'}\n"
"""A line of a job that ends early, since it finds no damage."""


def write(folder: Path, stage: str, do: str, more: str = "") -> Path:
    job = TINY.replace("align: none\n", "")
    align = "" if stage == "align" else "align: none\n"
    return damaged_box.write(folder, f"{job}{align}{stage}: {{use: acme, do: {json.dumps(do)}}}\n{more}", 1000)


def give(do: str) -> str:
    """Code that edits T, and gives a pose of it."""
    return do if "given" in do else f"{do}; given = Pose(T, 0.04, 0.9)"


@pytest.mark.parametrize("name", FAULTS)
def test_a_value_that_cannot_be_right_is_an_error_of_its_stage(name: str, site: Site, tmp_path: Path) -> None:
    stage, do, text = FAULTS[name]
    site.add("acme-bad", STAGES)
    job = write(tmp_path, stage, give(do) if stage == "align" else do)
    with pytest.raises(StageError) as caught:
        damageest.run(job)
    told = str(caught.value)
    assert told.startswith(f"{stage}: acme: gave a result that is not valid: "), told
    assert text in told
    assert "acme-bad 1.2" in told


def test_the_command_line_says_so_and_writes_nothing(site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", STAGES)
    job = write(tmp_path, "cluster", "given = Sites(given.label, 0)")
    done = CliRunner().invoke(app, ["run", "-q", str(job)])
    assert done.exit_code == 1
    assert "error: cluster: acme: gave a result that is not valid: label: expected 0 to 0" in done.stderr
    assert not (tmp_path / "out" / "job" / "result.json").exists()


ENDS = [
    "GeneratorExit()",
    "SystemExit(0)",
    "SystemExit('\\x1b[2Jbye')",
    "type('Stop', (BaseException,), {})('all of it')",
]


@pytest.mark.parametrize("what", ENDS)
def test_an_error_that_is_no_exception_stays_in_its_stage(what: str, site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", STAGES)
    with pytest.raises(StageError, match=r"align: acme: (raised|called).*which would end the run") as caught:
        damageest.run(write(tmp_path, "align", f"raise {what}"))
    assert "acme-bad 1.2" in str(caught.value)
    assert "\x1b" not in str(caught.value)


def test_an_interrupt_of_a_stage_is_an_interrupt(site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", STAGES)
    with pytest.raises(KeyboardInterrupt):
        damageest.run(write(tmp_path, "align", "raise KeyboardInterrupt"))


@pytest.mark.slow
def test_the_second_job_runs_after_an_error_that_is_no_exception(site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", STAGES)
    bad = write(tmp_path / "bad", "align", "raise GeneratorExit")
    good = damaged_box.write(tmp_path / "good", TINY, 1000)
    done = CliRunner().invoke(app, ["run", "-q", str(bad), str(good)])
    assert done.exit_code == 1
    assert "align: acme: raised GeneratorExit" in done.stderr
    assert (tmp_path / "good" / "out" / "job" / "result.json").exists()


@pytest.mark.slow
@pytest.mark.parametrize("what", ["GeneratorExit", "KeyboardInterrupt"])
def test_a_job_of_a_batch_names_the_stage_and_the_plugin(what: str, site: Site, tmp_path: Path) -> None:
    """What a Dask worker calls: it gives a row, whatever the job raises."""
    site.add("acme-bad", STAGES)
    job = write(tmp_path, "align", f"raise {what}")
    task = {"name": "a", "job": str(job), "settings": [], "output": str(tmp_path / "o"), "batch": f"test {what}"}
    row = work({**task, "memory": None, "timeout": 60.0, "stage_timeout": 60.0, "cache": True})
    assert row["outcome"] == "failed"
    if what == "KeyboardInterrupt":  # nobody has pressed Ctrl-C: the job's process gets none
        assert "KeyboardInterrupt" in row["error"]
    else:
        assert "align: acme" in row["error"]
        assert "acme-bad 1.2" in row["error"]


@pytest.mark.parametrize("error", ["GeneratorExit", "SystemExit", "type('Stop', (BaseException,), {})"])
@pytest.mark.parametrize("place", ["import", "hook"])
def test_a_plugin_that_raises_no_exception_as_it_is_loaded_is_broken(place: str, error: str, site: Site) -> None:
    hook = f"@hookimpl\ndef damageest_stages():\n    raise {error}('\\x1b[31mno')\n"
    site.add("acme-gone", f"raise {error}('\\x1b[31mno')" if place == "import" else hook)
    (fault,) = [fault for fault in Registry.discover().broken if fault.provider.name == "acme-gone"]
    assert "\\x1b[31mno" in fault.reason


WATCHER = """
class Watcher:
    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        if stage == "align":
            raise {error}("\\x1b[2J" + "x" * 10_000_000)
"""


@pytest.mark.variants(1)
@pytest.mark.parametrize("error", ["SystemExit", "RuntimeError"])
def test_an_observer_that_raises_is_a_warning_whatever_it_raises(error: str, site: Site, tiny_done: Path) -> None:
    import importlib

    site.add("acme-bad", STAGES)
    (site.folder / "acme_watch.py").write_text(
        "from damageest.registry.hookspecs import hookimpl\n" + WATCHER.format(error=error)
    )
    watcher = importlib.import_module("acme_watch").Watcher()
    with pytest.warns(RuntimeWarning, match=f"observes stage align, failed: {error}") as told:
        assert damageest.run(tiny_done, registry=Registry.discover([watcher])).status == "ok"
    assert all("\x1b" not in str(one.message) and len(str(one.message)) < 3 * MOST_TEXT for one in told)


LOUD = {
    "a refusal": "raise StageError('\\x1b[2J\\x07' + 'x' * 5_000_000, '\\x1b[31m' + 'y' * 5_000_000)",
    "an error": "raise ValueError('\\x1b[2J' + 'x' * 5_000_000)",
    "a note": "given = Pose(T, 0.04, 0.9, notes=('\\x1b[2J' + 'x' * 5_000_000,))",
    "a doubt": "given = Pose(T, 0.04, 0.9, doubts=(Reason('acme', '\\x1b[2J' + 'x' * 5_000_000, 'contradicts'),))",
    "a broken text": "given = Pose(T, 0.04, 0.9, notes=('\\ud800', '\\x00'))",
}


@pytest.mark.variants(2)
@pytest.mark.parametrize("name", LOUD)
def test_what_a_plugin_says_is_cleaned_and_cut(name: str, site: Site, tmp_path: Path) -> None:
    site.add("acme-loud", STAGES)
    job = write(tmp_path, "align", LOUD[name], "" if name == "a doubt" else NO_DAMAGE)
    done = CliRunner().invoke(app, ["run", str(job)])
    assert done.exit_code == (0 if name in ("a note", "a broken text") else 1), done.output[-500:]
    said = done.stdout + done.stderr
    assert "\\x1b" in said or "\\ud800" in said
    assert not {"\x1b", "\x07", "\x00", "\ud800"} & set(said)
    assert len(said) < 40_000
    if name in ("a note", "a doubt", "a broken text"):
        assert (tmp_path / "out" / "job" / "result.json").stat().st_size < 200_000


MAIN = "from damageest.isolation import supervise; supervise.END_SECONDS = 0.5; from damageest.cli import main; main()"
FORKED = [sys.executable, "-c", MAIN]
ALONE = [sys.executable, "-c", "from damageest.isolation import supervise\nsupervise.IS_POSSIBLE = False\n" + MAIN]
LEAVES = {
    "thread": "import threading, time; threading.Thread(target=time.sleep, args=(600,)).start()",
    "pool": "from concurrent.futures import ThreadPoolExecutor as E; import time; E().submit(time.sleep, 600)",
    "exit handler": "import atexit, time; atexit.register(time.sleep, 600)",
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "command"), [("thread", FORKED), ("exit handler", FORKED), ("pool", ALONE)])
def test_a_thread_that_a_plugin_leaves_does_not_keep_the_process(
    name: str, command: list[str], site: Site, tmp_path: Path
) -> None:
    site.add("acme-late", STAGES)
    job = write(tmp_path, "align", LEAVES[name], NO_DAMAGE)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site.folder), os.environ.get("PYTHONPATH", "")])}
    start = time.perf_counter()
    done = subprocess.run([*command, "run", str(job)], capture_output=True, text=True, env=env, timeout=60)
    assert time.perf_counter() - start < 50
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "out" / "job" / "result.json").read_text())["status"] == "ok"
    assert "written to" in done.stdout
    assert "a thread of a plugin or library still ran, so its process was ended" in done.stderr


@pytest.mark.slow
def test_a_thread_that_ends_in_time_is_waited_for(site: Site, tmp_path: Path) -> None:
    site.add("acme-late", STAGES)
    mark = tmp_path / "mark"
    late = f"import threading; threading.Timer(0.1, lambda: open({str(mark)!r}, 'w').close()).start()"
    hook = f"\n@hookimpl\ndef damageest_after_stage(stage):\n    if stage == 'report':\n        {late}\n"
    (site.folder / "acme_late.py").write_text((site.folder / "acme_late.py").read_text() + hook)
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site.folder), os.environ.get("PYTHONPATH", "")])}
    job = str(write(tmp_path, "align", "", NO_DAMAGE))
    command = [sys.executable, "-c", "from damageest.cli import main; main()", "run", job]
    done = subprocess.run(command, capture_output=True, text=True, env=env, timeout=60)
    assert done.returncode == 0, done.stderr
    assert mark.exists()
    assert "its process was ended" not in done.stderr
