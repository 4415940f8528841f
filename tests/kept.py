"""What is computed once for all processes of a run of pytest, and lies on disk."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from filelock import FileLock


def keep(test_run: Path, name: str, make: Callable[[Path], object]) -> Path:
    """The folder ``test_run / name``, which ``make`` fills when it is asked for first, in whichever process.

    ``test_run``: the fixture of that name. What makes it fails in each process that asks for it.
    """
    folder = test_run / name
    with FileLock(test_run / f"{name}.lock"):
        done = test_run / f"{name}.done"
        if not done.is_file():
            shutil.rmtree(folder, ignore_errors=True)  # of a process that failed
            folder.mkdir(parents=True)
            make(folder)
            done.touch()
    return folder
