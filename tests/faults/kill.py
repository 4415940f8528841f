"""Stops runs, batches, reports and runs of the app at random moments, in several ways, and checks what is left.

Usage: python -m tests.faults.kill [--count 100] [--seed 0] [--commands run,batch,report,app]
           [--ways kill,term,int,memory,disk] [--log FILE]

Before each trial the output folder holds a whole result of one tolerance; what is stopped computes it for another one.
After it the folder has to hold one of the two as a whole, and the same command has to give the second, byte by byte,
with no file left over. `disk` mounts a small file system, which needs root; without it, this way is left out.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import psutil

import damageest
from damageest.errors import DamageestError
from damageest.output.folder import open_output
from damageest.output.verification import DATED, find_changes
from tests import damaged_box

MAIN = "from damageest.cli import main; main()"
APP = """import pathlib, signal, sys
signal.signal(signal.SIGINT, signal.SIG_DFL)
from damageest_app.running.runner import Runner
done = Runner().call(sys.argv[1:], pathlib.Path())
sys.stdout.write(done.printed)
sys.stderr.write(done.messages)
sys.exit(done.status % 256)"""
"""What the app does when a person starts a run, without its page."""
WAYS = ("kill", "term", "int", "memory", "disk")
COMMANDS = ("run", "batch", "report", "app")
SIGNALS = {"kill": signal.SIGKILL, "term": signal.SIGTERM, "int": signal.SIGINT}
TOLERANCES = (0.4, 0.5)
DISK = 48 << 20
"""Bytes of the small file system that the files of `disk` are on."""
SECONDS = 150.0
"""Time after which what was stopped and has not ended hangs."""


@dataclass
class Trial:
    """``hit``: it did not end well by itself; ``faults``: what is wrong afterwards; ``stage``: where it was."""

    command: str
    way: str
    hit: bool
    status: int
    stage: str
    faults: list[str] = field(default_factory=list)
    words: str = ""


def strip(folder: Path) -> dict[str, bytes]:
    """The content of an output folder, without the seconds that each stage took, files with a date, and kept stages."""
    every = damaged_box.content(folder)
    found = {n: data for n, data in every.items() if not n.startswith("stages/") and n not in (*DATED, "report.pdf")}
    if "result.json" in found:
        content = json.loads(found.pop("result.json"))
        content.pop("stages")
        content["steps"] = [step["step"] for step in content["steps"]]
        content.pop("provenance")  # it has hashes of files with a date; `find_changes` compares them
        found["result.json"] = json.dumps(content).encode()
    return found


@dataclass
class Place:
    """A folder with a job, and the command whose runs are stopped there. ``right``: the content of its output folders
    for each tolerance; ``now``: the tolerance whose result they hold; ``length``: seconds that the command takes."""

    home: Path
    command: str
    right: dict[float, list[dict[str, bytes]]] = field(default_factory=dict)
    now: float = TOLERANCES[1]
    length: float = 0.0

    def prepare(self) -> None:
        """Writes the job, and the two results."""
        job = damaged_box.JOB
        if self.command == "report":
            job = job.replace("report: none\n", "report: {pdf: true}\n")
        damaged_box.write(self.home, job, 3000)
        shutil.copy(self.home / "job.yaml", self.home / "other.yaml")
        for tolerance in TOLERANCES:
            child = self.start(tolerance)
            begin = time.monotonic()
            told = child.communicate()
            assert child.returncode == 0, told
            self.length = time.monotonic() - begin
            self.right[tolerance] = [strip(one) for one in self.outputs]
        assert self.right[TOLERANCES[0]] != self.right[TOLERANCES[1]]

    @property
    def outputs(self) -> list[Path]:
        """Its output folders."""
        return [self.home / "out" / one for one in (("b/job", "b/other") if self.command == "batch" else ("job",))]

    def start(self, tolerance: float, fresh: bool = True) -> subprocess.Popen[str]:
        """The command, begun. ``fresh``: without kept stages; a report is made from them."""
        words = ["run", "job.yaml", "--set", f"tolerance={tolerance}"]
        if self.command == "batch":
            words = ["batch", "job.yaml", "other.yaml", "--workers", "2", "--out", "out/b", *words[2:]]
        if fresh and self.command != "report":
            words.append("--no-cache")
        code = APP if self.command == "app" else MAIN
        return subprocess.Popen(
            [sys.executable, "-c", code, *words],
            cwd=self.home, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
            env={**os.environ, "COLUMNS": "200"},
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a shell's background jobs ignore it
        )  # fmt: skip

    def run_again(self, tolerance: float) -> list[str]:
        """Does the same again, in this process where it can, and says what is wrong with what it gives."""
        try:
            if self.command == "batch":
                child = self.start(tolerance, fresh=False)
                told = child.communicate()
                assert child.returncode == 0, told
            else:
                damageest.run(self.home / "job.yaml", output=True, settings=[f"tolerance={tolerance}"])
        except (DamageestError, AssertionError) as error:
            return [str(error)]
        return self.find_faults((tolerance,), True)

    def find_faults(self, wanted: tuple[float, ...], finished: bool) -> list[str]:
        """What is wrong with the output folders, which should hold the result of one of the tolerances.

        ``finished``: the command has ended well, and nothing else may lie about.
        """
        faults = []
        for number, out in enumerate(self.outputs):
            held = out if out.is_dir() or finished else out.parent / f".{out.name}.old"  # between two renames
            if not any(strip(held) == self.right[one][number] for one in wanted):
                faults.append(f"{out.name}: holds neither result")
            elif wrong := [
                one for one in find_changes(held, open_output(held).content) if not one.startswith("input ")
            ]:
                faults.append(f"{out.name}: {wrong}")
            left = {one.name for one in out.parent.iterdir()} - {"job", "other", *BATCH}
            if finished and left:
                faults.append(f"left over: {left}")
        return faults


BATCH = ("batch.csv", "batch.json", "batch.html", ".batch.rows")


def try_once(place: Place, way: str, moment: float, rng: np.random.Generator) -> Trial:
    """Stops the command in one way, ``moment`` seconds after its start, and looks at what is left."""
    other = next(one for one in TOLERANCES if one != place.now)
    child = place.start(other)
    faults = []
    with contextlib.ExitStack() as undo:
        time.sleep(moment)
        family = _family(child.pid)
        if child.poll() is None:
            _stop(child, way, bool(rng.random() < 0.5), place.home, rng, undo)
        try:
            out, err = child.communicate(timeout=SECONDS)
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            out, err = child.communicate()
            faults.append("hangs")
        if running := _wait_for_all([*family, *_family(child.pid)]):
            faults.append(f"goes on: {running}")
    stages = [line.split(":")[0].strip() for line in err.splitlines() if line.startswith("  ")]
    words = (out + err)[-600:]
    is_before = child.returncode == -signal.SIGINT and "_call_app" not in err  # Python was reading the modules
    faults += [f"says {word}" for word in ("Traceback", "unexpected") if word in out + err and not is_before]
    trial = Trial(
        place.command, way, child.returncode != 0, child.returncode, stages[-1] if stages else "", faults, words
    )
    trial.faults += place.find_faults(TOLERANCES, False)
    trial.faults += [f"next run: {fault}" for fault in place.run_again(other)]
    place.now = other
    return trial


def _stop(
    child: subprocess.Popen[str],
    way: str,
    whole: bool,
    home: Path,
    rng: np.random.Generator,
    undo: contextlib.ExitStack,
) -> None:
    """``whole``: all processes of the command get the signal, as from a terminal, else that alone which was started."""
    if way in SIGNALS:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child.pid, SIGNALS[way]) if whole else os.kill(child.pid, SIGNALS[way])
    elif way == "memory":
        for one in _family(child.pid):
            with contextlib.suppress(psutil.Error, OSError):
                limit = one.memory_info().vms + int(rng.integers(0, 64 << 20))
                resource.prlimit(one.pid, resource.RLIMIT_AS, (limit, limit))
    else:
        filler = home / "filler"
        free = shutil.disk_usage(home).free - int(rng.integers(0, 200_000))
        undo.callback(filler.unlink, missing_ok=True)
        with contextlib.suppress(OSError):  # what runs may have taken the rest
            filler.write_bytes(bytes(max(free, 0)))


def _family(session: int) -> list[psutil.Process]:
    """The processes of a session, and those that its first one has started."""
    found = []
    for one in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            if os.getsid(one.pid) == session:
                found.append(one)
    with contextlib.suppress(psutil.Error):
        found += psutil.Process(session).children(recursive=True)
    return found


def _wait_for_all(family: list[psutil.Process]) -> list[str]:
    """The names of processes that go on 20 s after the command; they are ended then."""
    _, left = psutil.wait_procs(family, timeout=20)
    names = []
    for one in left:
        with contextlib.suppress(psutil.Error):
            names.append(" ".join(one.cmdline())[:200])
            one.kill()
    return names


@contextlib.contextmanager
def make_home(small: bool) -> Iterator[Path]:
    """A folder; ``small``: on a file system of its own, of `DISK` bytes."""
    with tempfile.TemporaryDirectory(prefix="damageest-kill-") as folder:
        if small:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", folder], check=True)
        try:
            yield Path(folder)
        finally:
            if small:
                subprocess.run(["umount", "--lazy", folder], check=True)


def stop_runs(count: int, seed: int, commands: tuple[str, ...], ways: tuple[str, ...], log: str = "") -> list[Trial]:
    """Trials: each command gets as many, and each way in turn."""
    rng, trials = np.random.default_rng(seed), []
    for command in commands:
        with make_home("disk" in ways) as home:
            place = Place(home, command)
            place.prepare()
            for number in range(count // len(commands)):
                moment = float(rng.uniform(0.3, 1.05 * place.length))
                trials.append(try_once(place, ways[number % len(ways)], moment, rng))
                if log:
                    with open(log, "a") as stream:
                        print(json.dumps(asdict(trials[-1])), file=stream)
                if any("holds neither" in fault or "next run" in fault for fault in trials[-1].faults):
                    shutil.rmtree(home / "out", ignore_errors=True)
                    place.prepare()
    return trials


def make_table(trials: list[Trial]) -> str:
    """A table in Markdown: trials of each command and way, those that were hit, and those with a fault."""
    lines = ["| command | way | trials | stopped | exit statuses | faults |", "|---|---|---|---|---|---|"]
    for command, way in dict.fromkeys((one.command, one.way) for one in trials):
        own = [one for one in trials if (one.command, one.way) == (command, way)]
        ends = ", ".join(f"{status} ({n})" for status, n in sorted(Counter(one.status for one in own).items()))
        hit, bad = (sum(bool(values) for values in ([t.hit for t in own], [t.faults for t in own])[k]) for k in (0, 1))
        lines.append(f"| {command} | {way} | {len(own)} | {hit} | {ends} | {bad} |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", default=",".join(COMMANDS))
    parser.add_argument("--ways", default=",".join(WAYS if os.getuid() == 0 else WAYS[:-1]))
    parser.add_argument("--log", default="", help="a file that gets a line of JSON for each trial")
    given = parser.parse_args()
    trials = stop_runs(
        given.count, given.seed, tuple(given.commands.split(",")), tuple(given.ways.split(",")), given.log
    )
    print(make_table(trials))
    stages = Counter(one.stage for one in trials if one.hit)
    print("stopped in:", ", ".join(f"{stage or 'start'} ({number})" for stage, number in stages.most_common()))
    for one in trials:
        if one.faults:
            print(asdict(one), file=sys.stderr)


if __name__ == "__main__":
    main()
