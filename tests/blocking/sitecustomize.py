"""Blocks imports in a Python process and in those that it starts: this folder on PYTHONPATH, and in the environment

``DAMAGEEST_BLOCKED``: top-level modules, separated by commas;
``DAMAGEEST_LACKS``: a shared library such as ``libGL.so.1``, which they then fail to load, as ctypes does. Without it
they are not installed.
"""

from __future__ import annotations

import ctypes
import os
import sys
from importlib.abc import Loader
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

BLOCKED = frozenset(filter(None, os.environ.get("DAMAGEEST_BLOCKED", "").split(",")))
LIBRARY = os.environ.get("DAMAGEEST_LACKS", "")
MESSAGE = f"{LIBRARY}: cannot open shared object file: No such file or directory"


class Lacking(Loader):
    """Loads a module as a compiled one loads whose shared library is missing."""

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return None

    def exec_module(self, module: ModuleType) -> None:
        raise ImportError(MESSAGE, name=module.__name__)


class Filtered:
    """A finder of modules that does not find the blocked ones: `importlib.util.find_spec` then says None, as where
    they are not installed. A finder of our own before the others could only raise."""

    def __init__(self, finder: Any) -> None:
        self.finder = finder

    def __getattr__(self, name: str) -> Any:
        return getattr(self.finder, name)

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if name.partition(".")[0] not in BLOCKED:
            found: ModuleSpec | None = self.finder.find_spec(name, path, target)
            return found
        return ModuleSpec(name, Lacking(), origin=f"without {LIBRARY}") if LIBRARY else None


class Library(ctypes.CDLL):
    def __init__(self, name: Any, *args: Any, **options: Any) -> None:
        if name == LIBRARY:
            raise OSError(MESSAGE)
        super().__init__(name, *args, **options)


if BLOCKED:
    sys.meta_path[:] = [Filtered(finder) for finder in sys.meta_path]
if LIBRARY:
    ctypes.CDLL = Library  # type: ignore[misc]
