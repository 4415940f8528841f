"""What native libraries do, for a worker process."""

from __future__ import annotations

import ctypes
import os
import sys

import numpy as np


def add(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first + second


def edit(first: np.ndarray) -> np.ndarray:
    first[0] = 7
    return first


def tell_process() -> int:
    return os.getpid()


def crash() -> None:
    ctypes.string_at(0)


def abort() -> None:
    sys.stderr.write("terminate called after throwing an instance of 'acme'\n")
    sys.stderr.flush()
    os.abort()


def end() -> None:
    os._exit(0)


def leave() -> None:
    sys.exit(0)


def fill_memory() -> float:
    return float(np.ones(4 * 10**12).sum())


def loop() -> None:
    while True:
        pass


def start_and_loop() -> None:
    """A process of its own that keeps the streams open, and then a hang."""
    import subprocess

    subprocess.Popen(["sleep", "60"])
    loop()


def raise_odd() -> None:
    class OddError(Exception):
        pass

    raise OddError("not known elsewhere")
