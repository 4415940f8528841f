"""A stage without a process of its own that crashes, exits, hangs or takes all memory: the command line names it, its
exit status is 1, the earlier output stays, and the jobs after it run."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import damageest
from tests import damaged_box
from tests.cli.calls import call
from tests.needs import needs_terminal
from tests.registry.test_registry import Site, site

__all__ = ["site"]
MAIN = [sys.executable, "-c", "from damageest.cli import main; main()", "run"]
FAULTY = '''
from damageest.artefacts import Part
from damageest.stages.part import ReadPart

class Faulty(ReadPart):
    """Does what its option says."""
    use: Literal["faulty"] = "faulty"
    fault: str
    def run(self, unit: str) -> Part:
        exec(self.fault)
        import trimesh  # not before: the command line does without it
        box = trimesh.creation.box((40, 30, 20))
        return Part(box.vertices, box.faces)

class Watcher:
    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        if stage == "align":
            raise SystemExit(0)

@hookimpl
def damageest_stages():
    return [Faulty]
'''
FAULTS = {
    "segmentation fault": ("import ctypes; ctypes.string_at(0)", "its process ended by a segmentation fault (SIGSEGV)"),
    "abort": ("import os; os.abort()", "its process ended by an abort (SIGABRT)"),
    "exit at once": ("import os; os._exit(0)", "ended its process with exit status 0"),
    "exit": ("import sys; sys.exit(0)", "called sys.exit(0), which would end the run"),
    "memory": ("import numpy as np; np.ones(30 * 10**9 // 8)", "ran out of memory"),
    "kill": ("import os; os.kill(os.getpid(), 9)", "its process was killed (SIGKILL)"),
    "hang": ("import time; time.sleep(600)", "was ended: not finished after 8 s, the time limit of a stage"),
}


def write_job(folder: Path, name: str, fault: str) -> Path:
    path = folder / f"{name}.yaml"
    part = f"part: {{use: faulty, fault: {json.dumps(fault)}}}"
    path.write_text(damaged_box.JOB.replace("tolerance: 0.2", "tolerance: 0.4").replace("part: box.stl", part))
    return path


def environment(site: Site) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(site.folder), os.environ.get("PYTHONPATH", "")])}


@pytest.mark.slow
def test_each_fault_is_named_and_the_next_job_runs(site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", FAULTY)
    damaged_box.write_small(tmp_path)
    jobs = [write_job(tmp_path, name, fault) for name, (fault, _) in FAULTS.items()]
    jobs.append(write_job(tmp_path, "sound", ""))
    for path in jobs:  # an output of an earlier run, so that none of them has to compute it
        (tmp_path / "out" / path.stem).mkdir(parents=True)
        (tmp_path / "out" / path.stem / "result.json").write_text('{"earlier": true}')
    before = damaged_box.content(tmp_path / "out")
    command = [*MAIN, *map(str, jobs), "--stage-timeout", "8", "--memory", "3GB", "--json"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(site), timeout=100)
    said = " ".join(done.stderr.split())
    assert done.returncode == 1, said
    for _, text in FAULTS.values():
        assert f"error: part: faulty: {text}" in said
    assert "acme-bad 1.2" in said
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [row["status"] for row in rows] == ["failed"] * len(FAULTS) + ["ok"]
    assert [Path(row["job"]).stem for row in rows[:-1]] == list(FAULTS)
    after = damaged_box.content(tmp_path / "out")
    old = [name for name in before if not name.startswith("sound/")]
    assert {name: after[name] for name in old} == {name: before[name] for name in old}
    assert json.loads(after["sound/result.json"])["sites"], "it was run"


ITEMS = """
import json, sys
from damageest.cli import _process
from damageest.isolation.limits import limit_this_process
from damageest.isolation.shared_notes import at_work, note_job
faults = json.loads(sys.argv[1])
def work(first):
    for number in range(first, len(faults)):
        note_job(number - first)
        with at_work("part: faulty", 0.5, "acme-bad 1.2"):
            exec(faults[number])
        print("done", number, flush=True)
    return 0
def report(error, name):
    print(name, error, flush=True)
    return 1
_process.is_command = True
_process.end_with_each(work, [str(number) for number in range(len(faults))], report)
"""


def test_each_fault_that_ends_the_process_is_named_and_the_next_item_is_done() -> None:
    """Those that end no process, `sys.exit` and want of memory, are errors of the stage."""
    names = [name for name in FAULTS if name not in ("exit", "memory")]
    faults = json.dumps([*(FAULTS[name][0] for name in names), "pass"])
    done = subprocess.run([sys.executable, "-c", ITEMS, faults], capture_output=True, text=True, timeout=100)
    assert done.returncode == 1, done.stderr
    *said, last = [line for line in done.stdout.splitlines() if line[:1].isdigit() or line.startswith("done")]
    assert last == f"done {len(names)}"
    assert len(said) == len(names)
    for number, name in enumerate(names):
        assert said[number].startswith(f"{number} part: faulty: {FAULTS[name][1]}".replace("8 s", "0.5 s"))


@pytest.mark.parametrize("name", ["exit", "memory"])
def test_a_fault_that_ends_no_process_is_an_error_of_the_stage(name: str, site: Site, tmp_path: Path) -> None:
    site.add("acme-bad", FAULTY)
    damaged_box.write_small(tmp_path)
    fault, text = ("raise MemoryError", "ran out of memory") if name == "memory" else FAULTS[name]
    status, said = call("run", write_job(tmp_path, "job", fault))
    assert status == 1
    assert f"error: part: faulty: {text}" in " ".join(said.split())
    assert "acme-bad 1.2" in said or name == "memory"


@pytest.mark.slow
def test_a_plugin_that_crashes_as_it_is_loaded_is_named(site: Site, tmp_path: Path) -> None:
    site.add("acme-broken", "import os; os.abort()")
    command = [*MAIN, str(damaged_box.write_small(tmp_path))]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(site))
    assert done.returncode == 1
    assert "the import of acme-broken 1.2: its process ended by an abort" in " ".join(done.stderr.split())


READER = '''
from typing import ClassVar
from damageest.artefacts import Part
from damageest.stages import JobPath
from damageest.stages.part import CadFace, ReadPart

class Acme(ReadPart):
    """Aborts."""
    reads: ClassVar[tuple[str, ...]] = (".acme",)
    isolated: ClassVar[bool] = ISOLATED
    use: Literal["acme"] = "acme"
    path: JobPath
    def run(self, unit: str) -> Part:
        import os; os.abort()
    def cad_faces(self, unit: str) -> tuple[CadFace, ...]:
        import os; os.abort()

@hookimpl
def damageest_stages():
    return [Acme]
'''


def add_reader(site: Site, folder: Path, body: str, isolated: bool = False) -> Path:
    """A file, whose reader does what ``body`` says."""
    site.add("acme-reader", READER.replace("ISOLATED", str(isolated)).replace("import os; os.abort()", body))
    (folder / "part.acme").write_text("x")
    return folder / "part.acme"


@pytest.mark.slow
@pytest.mark.parametrize("isolated", [True, False])
def test_a_reader_that_crashes_is_named_by_faces(isolated: bool, site: Site, tmp_path: Path) -> None:
    """As OpenCASCADE on a damaged file: with a process of its own it is the file's fault."""
    command = [*MAIN[:-1], "faces", str(add_reader(site, tmp_path, "import os; os.abort()", isolated))]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(site))
    said = " ".join(done.stderr.split())
    assert done.returncode == (2 if isolated else 1), said
    assert ("part.acme: the program that reads it" if isolated else "part: acme: its process ended by an abort") in said
    assert "acme-reader 1.2" in said


@pytest.mark.slow
def test_an_observer_that_exits_is_a_warning(site: Site, small_done: Path) -> None:
    import importlib

    from damageest.registry import Registry

    site.add("acme-bad", FAULTY)
    watcher = importlib.import_module("acme_bad").Watcher()
    with pytest.warns(RuntimeWarning, match="the observer Watcher, which observes stage align, failed: SystemExit"):
        assert damageest.run(small_done, registry=Registry.discover([watcher]), output=True).sites


@pytest.mark.slow
@needs_terminal()
@pytest.mark.parametrize("how", ["terminal", "killed"])
def test_the_process_that_works_ends_with_the_one_that_watches(how: str, site: Site, tmp_path: Path) -> None:
    """Ctrl-C on a terminal reaches both; SIGKILL only the one that watches."""
    mark = tmp_path / "mark"
    body = f"import os, time; open({str(mark)!r}, 'w').write(str(os.getpid())); time.sleep(600)"
    part = add_reader(site, tmp_path, body)
    child, terminal = pty.fork()
    if child == 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.execve(sys.executable, [*MAIN[:-1], "faces", str(part)], environment(site))
    try:
        end = time.monotonic() + 60
        while not (mark.exists() and mark.read_text()):
            assert time.monotonic() < end
            time.sleep(0.05)
        worker = int(mark.read_text())
        assert worker != child
        if how == "terminal":
            os.write(terminal, b"\x03")
        else:
            os.kill(child, signal.SIGKILL)
        text = b""
        while more := _read(terminal):
            text += more
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        assert status == (130 if how == "terminal" else -signal.SIGKILL)
        assert text.count(b"interrupted") == (how == "terminal")
        while Path(f"/proc/{worker}").exists():
            assert time.monotonic() < end
            time.sleep(0.01)
    finally:
        os.close(terminal)


@pytest.mark.slow
def test_a_crash_after_ctrl_c_is_an_end_by_ctrl_c(site: Site, tmp_path: Path) -> None:
    """Native code that calls Python may abort where it is interrupted."""
    mark = tmp_path / "mark"
    body = (
        "import os, signal, time; signal.signal(signal.SIGINT, lambda *_, end=os.abort: end()); "
        f"open({str(mark)!r}, 'w').close(); time.sleep(600)"
    )
    part = add_reader(site, tmp_path, body)
    with subprocess.Popen(
        [*MAIN[:-1], "faces", str(part)], stderr=subprocess.PIPE, text=True, env=environment(site),
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as child:  # fmt: skip
        end = time.monotonic() + 60
        while not mark.exists():
            assert time.monotonic() < end
            time.sleep(0.05)
        os.killpg(child.pid, signal.SIGINT)
        _, err = child.communicate(timeout=60)
    assert child.returncode == 130, err
    assert "interrupted; finished stages are kept" in err
    assert "error" not in err


def _read(terminal: int) -> bytes:
    try:
        return os.read(terminal, 1 << 12)
    except OSError:  # the other end is closed
        return b""


@pytest.mark.slow
def test_what_a_plugin_left_open_is_written_before_the_process_ends(site: Site, tmp_path: Path) -> None:
    """The fork ends without taking down its objects; its threads, exit handlers and files come first."""
    left = (
        "import atexit, builtins, threading\n"
        "builtins.left = open('left.txt', 'w')\n"
        "left.write('whole')\n"
        "atexit.register(lambda: left.write(', handler called'))\n"
        "threading.Thread(target=lambda: (__import__('time').sleep(1), left.write(', thread ended'))).start()\n"
    )
    command = [*MAIN[:-1], "faces", str(add_reader(site, tmp_path, f"exec({left!r}); return ()"))]
    done = subprocess.run(command, capture_output=True, text=True, env=environment(site), cwd=tmp_path, timeout=100)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "left.txt").read_text() == "whole, thread ended, handler called"
