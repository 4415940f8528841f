"""Spoils files of everything that is read, has them read in a process of its own, and counts what comes of it.

Usage: python -m tests.faults.run [--count 2000] [--seed 0] [--whole 0.1] [--names part.step,part.iges] [--log FILE]

`--whole` is the share of the jobs that are run to their end over an earlier output; of the others the inputs are read.
"""

from __future__ import annotations

import argparse
import json
import random
import select
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import psutil

from tests import damaged_box
from tests.faults import others, seeds
from tests.faults.mutations import KINDS, spoil
from tests.faults.worker import KEPT, MEMORY

SECONDS = 60.0
"""Time that one file may take; a sound one takes less than one second, OpenCASCADE's start three."""
OUTCOMES = ("refused", "stopped", "done", "unexpected", "crash", "hang", "memory", "lost")
GOOD = OUTCOMES[:3]
"""refused: exit status 2; stopped: a stage refused it, exit status 1; done: a result. Of the others, lost means that
neither the earlier nor a new output is whole."""
NAMES = [*seeds.SCANS, *seeds.PARTS, *seeds.JOBS, *others.FILES]
Row = dict[str, Any]


class Case(NamedTuple):
    """A spoiled file: name of the sound one, way of spoiling, bytes, and whether a job is run to its end."""

    name: str
    kind: str
    data: bytes
    whole: bool = False


@dataclass
class Worker:
    """A child process that runs one job after the other. It is started anew after a crash or a hang."""

    child: subprocess.Popen[str] | None = field(default=None, repr=False)
    peak: int = 0
    """Memory of the largest process below the child, in bytes, as far as it was seen."""

    def try_job(self, path: Path, mode: str = "read", seconds: float = SECONDS) -> Row:
        """The outcome of one job or file."""
        if self.child is None:
            self.start()
        assert self.child
        assert self.child.stdin
        self.peak = 0
        self.child.stdin.write(f"{mode} {path}\n")
        self.child.stdin.flush()
        answer = self._wait(seconds)
        if answer.startswith("{"):
            row: Row = json.loads(answer)
            row["peak"] = max(row["peak"], self.peak)
            return row if row["peak"] <= MEMORY else {**row, "outcome": "memory"}
        self.stop()
        assert self.child
        status = self.child.returncode
        self.child = None
        return {"outcome": answer or "crash", "words": f"exit status {status}", "seconds": seconds, "peak": self.peak}

    def start(self) -> None:
        """Starts the child, which then waits for jobs."""
        command = [sys.executable, "-m", "tests.faults.worker"]
        root = Path(__file__).parents[2]
        self.child = subprocess.Popen(command, stdin=-1, stdout=-1, text=True, bufsize=1, cwd=root)
        assert self._wait(120) == "ready\n"

    def _wait(self, seconds: float) -> str:
        """The next line of the child, or what went wrong: 'hang', 'memory', or '' where it died."""
        assert self.child
        assert self.child.stdout
        tree = psutil.Process(self.child.pid)
        for _ in range(int(seconds / 0.1)):
            if select.select([self.child.stdout], [], [], 0.1)[0]:
                return self.child.stdout.readline()
            try:
                every = [tree, *tree.children(recursive=True)]
                self.peak = max(self.peak, *(one.memory_info().rss for one in every))
            except psutil.Error:
                continue
            if self.peak > 1.5 * MEMORY:
                return "memory"
        return "hang"

    def stop(self) -> None:
        """Ends the child and its children."""
        if self.child is None:
            return
        for one in psutil.Process(self.child.pid).children(recursive=True) if self.child.poll() is None else []:
            one.kill()
        self.child.kill()
        self.child.wait()


def make_cases(count: int, seed: int, names: list[str], share: float = 0.0) -> Iterator[Case]:
    """Spoiled files. The same arguments, the same files; the first of a larger count are those of a smaller one."""
    for number in range(count):
        name = names[number % len(names)]
        kind = KINDS[sum(divmod(number, len(names))) % len(KINDS)]  # the first few already have every way
        whole = name not in others.FILES and random.Random(f"{seed}/whole/{number}").random() < share
        yield Case(name, kind, spoil(find_seed(name), name, kind, random.Random(f"{seed}/{name}/{number}")), whole)


def find_seed(name: str) -> bytes:
    """The sound file of a name."""
    return others.find_seed(name) if name in others.FILES else seeds.seed(name)


def write_case(folder: Path, case: Case) -> Path:
    """Writes a file with what it is read together with, and gives the path that is to be tried."""
    place = folder
    if case.name in others.IN_OUTPUT:
        place = folder / "read"
        for name, data in others.output().items():
            (place / name).parent.mkdir(parents=True, exist_ok=True)
            (place / name).write_bytes(data)
    (place / case.name).write_bytes(case.data)
    if case.name in seeds.JOBS or case.name in others.FILES:
        return place / case.name
    (folder / "given.yaml").write_text(seeds.make_job(case.name))
    return folder / "given.yaml"


def fuzz(
    count: int,
    seed: int = 0,
    whole: float = 0.0,
    names: list[str] | None = None,
    tell: Callable[[Row], None] = lambda row: None,
    first: int = 0,
    worker: Worker | None = None,
) -> list[Row]:
    """The outcome of each spoiled file, from the number ``first`` on. ``worker``: one that goes on afterwards."""
    own, rows = worker or Worker(), list[Row]()
    with tempfile.TemporaryDirectory() as held:
        folder = Path(held)
        seeds.write_others(folder)
        if whole:
            make_earlier(folder, own)
        try:
            for number, case in islice(enumerate(make_cases(count, seed, names or NAMES, whole)), first, None):
                before = damaged_box.content(folder / KEPT) if case.whole else {}
                row = own.try_job(write_case(folder, case), "run" if case.whole else "read")
                if case.whole and (lost := find_loss(folder / KEPT, before, row["outcome"])):
                    row |= {"outcome": "lost", "words": f"{lost}; was {row['outcome']}: {row.get('words')}"}
                    make_earlier(folder, own)
                rows.append({"number": number, "name": case.name, "kind": case.kind, "whole": case.whole, **row})
                tell(rows[-1])
        finally:
            if worker is None:
                own.stop()
    return rows


def make_earlier(folder: Path, worker: Worker) -> None:
    """The earlier output, of sound files."""
    (folder / "sound.yaml").write_text(seeds.make_job("points.npy"))
    assert worker.try_job(folder / "sound.yaml", "run")["outcome"] == "done"


def find_loss(folder: Path, before: dict[str, bytes], outcome: str) -> str:
    """What is wrong with an output folder after a run: a run that gave no result has to leave it as it was, and one
    that did has to leave a whole one."""
    from damageest.output.folder import open_output
    from damageest.output.verification import find_changes

    if outcome != "done":
        after = damaged_box.content(folder)
        other = sorted(name for name in {*before, *after} if before.get(name) != after.get(name))
        return ", ".join(name for name in other if not name.startswith("stages/"))  # kept stages are no result
    changes = find_changes(folder, open_output(folder).content)
    left = [one.name for one in folder.parent.iterdir() if one.name != folder.name]
    return "; ".join([*(one for one in changes if not one.startswith("input ")), *left])


def make_table(rows: list[Row]) -> str:
    """A table in Markdown: how many files of each format had each outcome. ``faults``: those of damageest, by kind."""
    lines = ["| format | files | run | " + " | ".join(GOOD) + " | faults | slowest, s | most memory, MB |"]
    lines += ["|---" * (len(GOOD) + 6) + "|"]
    for name in [*dict.fromkeys(row["name"] for row in rows), "all"]:
        own = [row for row in rows if name in (row["name"], "all")]
        counts = Counter(row["outcome"] for row in own)
        faults = ", ".join(f"{one} {counts[one]}" for one in OUTCOMES if one not in GOOD and counts[one])
        cells = [name, len(own), sum(row["whole"] for row in own), *(counts[one] for one in GOOD), faults or 0]
        cells += [f"{max(row['seconds'] for row in own):.1f}", f"{max(row['peak'] for row in own) / 1e6:.0f}"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--names", default="")
    parser.add_argument("--whole", type=float, default=0.1, help="share of the jobs that are run to their end")
    parser.add_argument("--log", default="", help="a file that gets a line of JSON for each file that was tried")
    parser.add_argument("--first", type=int, default=0, help="number of the file to begin with, to go on after a break")
    parser.add_argument("--keep", default="", help="a folder for the files with a bad outcome")
    given = parser.parse_args()
    names = given.names.split(",") if given.names else NAMES

    def tell(row: Row) -> None:
        if given.log:
            with open(given.log, "a") as stream:
                print(json.dumps(row), file=stream)

    rows = fuzz(given.count, given.seed, given.whole, names, tell, given.first)
    print(make_table(rows))
    bad = [row for row in rows if row["outcome"] not in GOOD]
    for row in bad:
        print(row, file=sys.stderr)
    if given.keep and bad:
        Path(given.keep).mkdir(parents=True, exist_ok=True)
        every = list(make_cases(given.count, given.seed, names, given.whole))
        for row in bad:
            Path(given.keep, f"{row['number']}-{row['name']}").write_bytes(every[row["number"]].data)


if __name__ == "__main__":
    main()
