"""Progress on a terminal and in a pipe, and what is said and kept after an interrupt."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from damageest.artefacts import Sites
from damageest.cli import app
from damageest.cli._progress import Progress
from tests import damaged_box
from tests.cli.conftest import Ran
from tests.needs import needs_terminal
from tests.registry.test_registry import Site, site

__all__ = ["site"]

MAIN = [sys.executable, "-c", "from damageest.cli import main; main()"]


def read_until(stream: object, word: str) -> str:
    """What a process writes until a word has come."""
    text = ""
    while word not in text and (more := os.read(stream.fileno(), 1)):  # type: ignore[attr-defined]
        text += more.decode()
    return text


def read_terminal(master: int) -> bytes:
    """What was written to the other end of a terminal, which is standard error and is closed here."""
    sys.stderr.close()
    shown = b""
    with contextlib.suppress(OSError):  # that is how it says that this was all
        while more := os.read(master, 1 << 16):  # the terminal hands on what was written in several pieces
            shown += more
    os.close(master)
    return shown


def allow_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # shells let what runs in the background ignore it


DROPPING = """
import signal, sys, time
from damageest.cli import app, main
class Dying:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)
@app.command("die")
def die():
    dying = Dying()
    del dying
    time.sleep(30)
sys.argv = ["damageest", "die"]
main()
"""


def test_an_interrupt_in_a_destructor_is_not_lost() -> None:
    """Python only prints an exception there, and the run would go on."""
    done = subprocess.run(
        [sys.executable, "-c", DROPPING], capture_output=True, text=True, preexec_fn=allow_interrupts, timeout=25,
    )  # fmt: skip
    assert done.returncode == 130, done.stderr
    assert done.stderr.splitlines() == [
        "interrupted; finished stages are kept, and the same command continues after them"
    ]


WAITING = '''
import time
from pathlib import Path
from damageest.artefacts import Part, Pose, Scan
from damageest.errors import StageError
from damageest.stages.align import Align

class Waiting(Align):
    """Waits where nobody has told it not to."""
    use: Literal["waiting"] = "waiting"
    mark: str
    def run(self, scan: Scan, part: Part, tolerance: float) -> Pose:
        if not Path(self.mark).exists():
            time.sleep(600)
        raise StageError("waited enough", "")

@hookimpl
def damageest_stages():
    return [Waiting]
'''


@pytest.mark.slow
@pytest.mark.parametrize("is_run_again", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_an_interrupt_says_what_is_kept(is_run_again: bool, site: Site, tmp_path: Path) -> None:
    site.add("acme-waiting", WAITING)
    waiting = f"align: {{use: waiting, mark: {tmp_path / 'mark'}}}"
    job = damaged_box.write(tmp_path, damaged_box.JOB.replace("align: none", waiting), 500)
    process = subprocess.Popen(
        [*MAIN, "run", str(job)], stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, preexec_fn=allow_interrupts,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(site.folder), os.environ.get("PYTHONPATH", "")])},
    )  # fmt: skip
    assert process.stderr
    text = read_until(process.stderr, "align: ")  # a stage is named when it begins
    process.send_signal(signal.SIGINT)
    text += process.stderr.read().decode()
    assert process.wait() == 130
    kept = tmp_path / "out/job/stages"
    assert f"interrupted in align: waiting; kept in {kept}: part, scan;" in text
    assert text.splitlines()[-1].startswith("interrupted")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["job"], "nothing hidden"
    assert {path.name.partition("-")[0] for path in kept.iterdir()} >= {"part", "scan"}
    if not is_run_again:
        return
    (tmp_path / "mark").touch()
    again = CliRunner().invoke(app, ["run", str(job)])
    assert "waited enough" in again.stderr
    assert again.stderr.count("from an earlier run") >= 2


def test_the_lines_of_a_run_say_where_its_time_went(command_run: Ran) -> None:
    wall = command_run.seconds
    lines = dict(re.findall(r"^  (\S.*?) +(\d+\.\d\d) s$", command_run.stderr, re.M))
    whole = float(lines.pop("the whole run"))
    assert 0.5 * wall < whole <= wall + 0.05  # what is left: the start of Python, long on a busy machine
    rest = float(lines.pop("rest", 0))
    assert rest < 0.3 * whole
    assert sum(map(float, lines.values())) + rest == pytest.approx(whole, abs=0.1)
    assert float(lines["start of the program"]) > 0
    content = json.loads((command_run.folder / "out/job/result.json").read_text())
    assert {one["step"] for one in content["steps"]} >= {"inspect_skin"}


@needs_terminal()
def test_on_a_terminal_sites_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = pty.openpty()
    monkeypatch.setattr(sys, "stderr", os.fdopen(slave, "w"))
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    progress = Progress(quiet=False)
    assert progress.console.is_terminal
    with progress.show_job("part [1/2]"):
        progress.damageest_before_stage("cluster", "dbscan", 0)
        progress.damageest_after_stage("cluster", 0, Sites([1, 2, 0], 2), 1.5, False)
        for site in (1, 2):
            progress.damageest_before_stage("boolean", "manifold", site)
            assert progress.live
            assert progress.live.tasks[0].description == f"boolean: manifold, site {site} of 2"
            progress.damageest_after_stage("boolean", site, None, 0.25, False)
        progress.damageest_before_stage("export", "files", 0)
        progress.damageest_after_stage("export", 0, None, 0.1, True)
    shown = read_terminal(master)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())
    assert "part [1/2]" in text
    assert re.search(r"cluster: dbscan +1\.50 s", text)
    assert re.search(r"boolean: manifold, 2 sites +0\.50 s", text)
    assert re.search(r"export: files +from an earlier run", text)


def test_stages_that_do_nothing_are_not_listed_and_stay_in_the_result(command_run: Ran) -> None:
    assert "boolean: manifold, site 1" in command_run.stderr
    listed = re.findall(r"^  (\w+): \w+", command_run.stderr, re.MULTILINE)
    assert listed == ["part", "scan", "align", "segment", "cluster", "enclose", "boolean", "allowance", "export"]
    stages = json.loads((command_run.folder / "out/job/result.json").read_text())["stages"]
    assert ("path", "none") in {(one["stage"], one["use"]) for one in stages}


@needs_terminal()
def test_on_a_terminal_a_stage_that_does_nothing_is_not_listed(monkeypatch: pytest.MonkeyPatch) -> None:
    master, slave = pty.openpty()
    monkeypatch.setattr(sys, "stderr", os.fdopen(slave, "w"))
    monkeypatch.setenv("TERM", "xterm")
    progress = Progress(quiet=False)
    with progress.show_job("part"):
        for stage, use in (("boolean", "manifold"), ("allowance", "none"), ("boolean", "manifold")):
            progress.damageest_before_stage(stage, use, 1)
            progress.damageest_after_stage(stage, 1, None, 0.25, False)
    shown = read_terminal(master)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown.decode())
    assert "allowance" not in text
    assert re.search(r"boolean: manifold, 2 sites +0\.50 s", text)


def test_quiet_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    progress = Progress(quiet=True)
    with progress.show_job("part"):
        progress.damageest_before_stage("cluster", "dbscan", 0)
        progress.damageest_stage_failed("cluster", "dbscan", 0)
    assert capsys.readouterr() == ("", "")
