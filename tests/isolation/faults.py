"""What native libraries do, for a worker process."""

from __future__ import annotations

import ctypes
import os
import sys
import time

import numpy as np

from damageest.isolation import at_work, call_isolated, tell_part


def add(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    return first + second


def edit(first: np.ndarray) -> np.ndarray:
    first[0] = 7
    return first


def tell_process() -> int:
    return os.getpid()


def work_in_parts(seconds: float, limit: float) -> None:
    """Part after part, without end."""
    number = 0
    while number >= 0:
        number += 1
        with at_work(f"part {number}", limit):
            end = time.process_time() + seconds
            while time.process_time() < end:
                pass


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


def crash_at_work() -> None:
    with at_work("cutting", owner="acme"):
        with at_work("measuring"):
            pass
        os.abort()


def raise_at_work() -> None:
    with at_work("cutting"), at_work("measuring"):
        raise ValueError("no such thing")


def fill_memory_at_work() -> None:
    with at_work("cutting"):
        fill_memory()


def wait_at_work(seconds: float, limit: float, steps: int = 1) -> int:
    """Uses no processor."""
    for _ in range(steps):
        with at_work("waiting", limit):
            time.sleep(seconds)
    return steps


def work_at_work(limit: float) -> None:
    with at_work("working", limit):
        loop()


def tell_nested_process() -> tuple[int, int]:
    return os.getpid(), call_isolated(tell_process, {}, worker="nested")


def use(size: int, seconds: float) -> None:
    """Holds so many bytes, and uses so much time of the processor."""
    held = np.ones(size, np.uint8)
    end = time.process_time() + seconds
    while time.process_time() < end:
        held[0] += 1


def tell_parts(seconds: float) -> None:
    """One piece of work that tells its parts."""
    with at_work("the deposit"):
        tell_part("face 3")
        time.sleep(seconds)
