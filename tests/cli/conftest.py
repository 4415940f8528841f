"""Runs that several tests of the command line read."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

import damageest
from damageest.registry import Registry
from tests import damaged_box
from tests.kept import keep


@dataclass(frozen=True)
class Ran:
    """What a command printed, the folder that it ran in, and its seconds."""

    folder: Path
    stdout: str
    stderr: str
    seconds: float


@pytest.fixture(scope="session")
def command_run(test_run: Path) -> Ran:
    """``damageest run job.yaml`` in a process of its own, on the least damaged box with stock to mill off."""

    def make(folder: Path) -> None:
        stock = "allowance: {use: milling, outer: 1, inner: 0.5}\n"
        damaged_box.write_least(folder, stock)
        command = [sys.executable, "-c", "from damageest.cli import main; main()", "run", "job.yaml"]
        begin = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)
        seconds = time.perf_counter() - begin
        assert done.returncode == 0, done.stderr
        (folder / "told").write_text(json.dumps([done.stdout, done.stderr, seconds]))

    folder = keep(test_run, "command_run", make)
    return Ran(folder, *json.loads((folder / "told").read_text()))


@pytest.fixture(scope="session")
def least_job(test_run: Path, registry: Registry) -> Path:
    """The folder of the job of `damaged_box.write_least`, with its output ``out/job``. Nobody changes it."""

    def make(folder: Path) -> None:
        damageest.run(damaged_box.write_least(folder), registry=registry, output=True)

    return keep(test_run, "least_job", make)


@pytest.fixture
def least_done(least_job: Path, tmp_path: Path) -> Path:
    """A copy of that job in ``tmp_path``: the job file."""
    shutil.copytree(least_job, tmp_path, dirs_exist_ok=True)
    return tmp_path / "job.yaml"
