"""Kills runs of a job by SIGKILL at random moments, and checks what is left.

Usage: python -m tests.faults.kill [--count 100] [--seed 0]
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import damageest
from tests import damaged_box

MAIN = [sys.executable, "-c", "from damageest.cli import main; main()"]


@dataclass
class Count:
    """``hit``: runs that were killed before their end; ``spoiled``: of these, those after which the earlier output was
    not whole; ``other``: those after which the next run gave other bytes or left files; ``stages``: where they were."""

    hit: int = 0
    late: int = 0
    spoiled: int = 0
    other: int = 0
    stages: tuple[str, ...] = ()


def strip(folder: Path) -> dict[str, bytes]:
    """The content of an output folder, without the seconds that each stage took and without the kept stages."""
    found = {name: data for name, data in damaged_box.content(folder).items() if not name.startswith("stages/")}
    if "result.json" in found:
        content = json.loads(found.pop("result.json"))
        content.pop("stages")
        content["steps"] = [step["step"] for step in content["steps"]]
        found["result.json"] = json.dumps(content).encode()
    return found


def kill_runs(home: Path, count: int, seed: int = 0) -> Count:
    """Runs a job ``count`` times over an earlier output, each killed at a moment of its own. Every second time only the
    process is killed that the shell knows, else all of the run at once."""
    path = damaged_box.write_small(home)
    child, _ = _start(path)
    start = time.monotonic()
    assert child.wait() == 0
    length = time.monotonic() - start
    out, result = home / "out/job", Count()
    right = strip(out)
    for number, moment in enumerate(np.random.default_rng(seed).uniform(0, 1.1 * length, count)):
        status, stage = _kill_one(path, float(moment), number % 2 == 0)
        result.hit += status == -signal.SIGKILL
        result.late += status == 0
        result.stages = (*result.stages, stage)
        held = out if out.is_dir() else home / "out/.job.old"  # between two renames
        result.spoiled += strip(held) != right
        damageest.run(path, output=True)
        result.other += strip(out) != right or [one.name for one in (home / "out").iterdir()] != ["job"]
    return result


def _start(path: Path) -> tuple[subprocess.Popen[bytes], bytes]:
    """A run that has begun with its first stage, and what it has printed."""
    command = [*MAIN, "run", str(path), "--no-cache"]
    child = subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True)
    assert child.stderr
    text = b""
    while b"  part:" not in text:
        text += os.read(child.stderr.fileno(), 1 << 12)
    return child, text


def _kill_one(path: Path, moment: float, whole: bool) -> tuple[int, str]:
    """The exit status, and the stage that the run named last."""
    child, text = _start(path)
    assert child.stderr
    time.sleep(moment)
    if child.poll() is None:
        os.killpg(child.pid, signal.SIGKILL) if whole else child.kill()
    text += child.stderr.read()  # until every process of the run has ended
    child.stderr.close()
    stages = [line.split(":")[0].strip() for line in text.decode().splitlines() if line.startswith("  ")]
    return child.wait(), stages[-1] if stages else ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        found = kill_runs(Path(home), given.count, given.seed)
    print(
        f"{given.count} runs: {found.hit} killed, {found.late} had ended; earlier output not whole: {found.spoiled}; "
    )
    print(f"next run with other bytes or files left over: {found.other}")
    print("killed in:", {stage: found.stages.count(stage) for stage in dict.fromkeys(found.stages)})


if __name__ == "__main__":
    main()
