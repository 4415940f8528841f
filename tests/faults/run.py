"""Spoils files of every format, has them read in a process of its own, and counts what comes of it.

Usage: python -m tests.faults.run [--count 2000] [--seed 0] [--run] [--names part.step,part.iges] [--table]
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
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from tests.faults import seeds
from tests.faults.mutations import KINDS, spoil
from tests.faults.worker import MEMORY

SECONDS = 30.0
"""Time that one file may take; a sound one takes less than one second, OpenCASCADE's start three."""
OUTCOMES = ("refused", "stopped", "done", "unexpected", "crash", "hang", "memory")
GOOD = OUTCOMES[:3]
"""refused: exit status 2; stopped: a stage refused it, exit status 1; done: a result."""
Row = dict[str, Any]


@dataclass
class Worker:
    """A child process that runs one job after the other. It is started anew after a crash or a hang."""

    mode: str = "read"
    child: subprocess.Popen[str] | None = field(default=None, repr=False)

    def try_job(self, path: Path, seconds: float = SECONDS) -> Row:
        """The outcome of one job."""
        if self.child is None:
            command = [sys.executable, "-m", "tests.faults.worker", self.mode]
            root = Path(__file__).parents[2]
            self.child = subprocess.Popen(command, stdin=-1, stdout=-1, text=True, bufsize=1, cwd=root)
            assert self._wait(120) == "ready\n"
        assert self.child.stdin
        self.child.stdin.write(f"{path}\n")
        self.child.stdin.flush()
        answer = self._wait(seconds)
        if answer.startswith("{"):
            row: Row = json.loads(answer)
            return row
        self.stop()
        status = self.child.returncode
        self.child = None
        return {"outcome": answer or "crash", "words": f"exit status {status}", "seconds": seconds, "peak": 0}

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
                if max(one.memory_info().rss for one in every) > 1.5 * MEMORY:
                    return "memory"
            except psutil.Error:
                continue
        return "hang"

    def stop(self) -> None:
        """Ends the child and its children."""
        if self.child is None:
            return
        for one in psutil.Process(self.child.pid).children(recursive=True) if self.child.poll() is None else []:
            one.kill()
        self.child.kill()
        self.child.wait()


def make_cases(count: int, seed: int, names: list[str]) -> Iterator[tuple[str, str, bytes]]:
    """Spoiled files: the name of the sound one, the way of spoiling, and the bytes. The same arguments, the same files;
    the first ones of a larger count are those of a smaller one."""
    for number in range(count):
        name = names[number % len(names)]
        kind = KINDS[number // len(names) % len(KINDS)]
        rng = random.Random(f"{seed}/{name}/{number}")
        yield name, kind, spoil(seeds.seed(name), name, kind, rng)


def fuzz(count: int, seed: int = 0, mode: str = "read", names: list[str] | None = None) -> list[Row]:
    """The outcome of each spoiled file."""
    names = names or [*seeds.SCANS, *seeds.PARTS, *seeds.JOBS]
    worker, rows = Worker(mode), list[Row]()
    with tempfile.TemporaryDirectory() as held:
        folder = Path(held)
        seeds.write_others(folder)
        try:
            for number, (name, kind, data) in enumerate(make_cases(count, seed, names)):
                (folder / name).write_bytes(data)
                if name not in seeds.JOBS:
                    (folder / "job.yaml").write_text(seeds.make_job(name))
                rows.append({"number": number, "name": name, "kind": kind, **worker.try_job(folder / "job.yaml")})
        finally:
            worker.stop()
    return rows


def make_table(rows: list[Row]) -> str:
    """A table in Markdown: how many files of each format had each outcome."""
    lines = ["| format | files | " + " | ".join(OUTCOMES) + " | slowest, s | most memory, MB |"]
    lines += ["|---" * (len(OUTCOMES) + 4) + "|"]
    for name in [*dict.fromkeys(row["name"] for row in rows), "all"]:
        own = [row for row in rows if name in (row["name"], "all")]
        counts = Counter(row["outcome"] for row in own)
        cells = [name, len(own), *(counts[one] for one in OUTCOMES)]
        cells += [f"{max(row['seconds'] for row in own):.1f}", f"{max(row['peak'] for row in own) / 1e6:.0f}"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--names", default="")
    parser.add_argument("--run", action="store_true", help="run the whole job, not only its reading")
    parser.add_argument("--keep", default="", help="a folder for the files with a bad outcome")
    given = parser.parse_args()
    names = given.names.split(",") if given.names else None
    rows = fuzz(given.count, given.seed, "run" if given.run else "read", names)
    print(make_table(rows))
    bad = [row for row in rows if row["outcome"] not in GOOD]
    for row in bad:
        print(row, file=sys.stderr)
    if given.keep and bad:
        Path(given.keep).mkdir(parents=True, exist_ok=True)
        every = list(make_cases(given.count, given.seed, names or [*seeds.SCANS, *seeds.PARTS, *seeds.JOBS]))
        for row in bad:
            name, _, data = every[row["number"]]
            Path(given.keep, f"{row['number']}-{name}").write_bytes(data)


if __name__ == "__main__":
    main()
