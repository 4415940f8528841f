"""Which program runs Python in a worker: this process may be another program that has Python within."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from damageest.errors import StageError

VARIABLE = "DAMAGEEST_PYTHON"
"""Variable of the environment that names the interpreter."""
_PYTHON = re.compile(r"(python|pypy)[w\d.]*(\.exe)?", re.IGNORECASE)


def find_python() -> str:
    """The path of a Python interpreter. In CAD programs that embed Python, and in frozen programs, ``sys.executable``
    is that program: with it, each worker would open one more of its windows.

    Raises StageError where none is found.
    """
    if named := os.environ.get(VARIABLE):
        return named
    if sys.executable and _PYTHON.fullmatch(Path(sys.executable).name):
        return sys.executable
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    names = (f"bin/python{version}", "bin/python3", "python.exe", "bin/python.exe")
    for folder in dict.fromkeys((sys.exec_prefix, sys.base_exec_prefix)):
        for name in names:
            if (found := Path(folder) / name).is_file():
                return str(found)
    raise StageError(
        f"it needs a process of its own, and {sys.executable or 'this program'} is no Python interpreter that could "
        "run one",
        f"set {VARIABLE} to a Python {version} interpreter",
        code="missing",
    )
