"""Runs a function on parts of the data in threads: numpy and scipy compute large arrays without the global lock."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterable
from typing import TypeVar

Item = TypeVar("Item")
Value = TypeVar("Value")

MOST = 8
"""Threads at most: each holds the intermediate arrays of its item."""


def count_cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def count_threads() -> int:
    """The threads to use: the cores of this process, or fewer by OMP_NUM_THREADS, for example for one job of many."""
    cores = count_cores()
    with contextlib.suppress(ValueError):
        cores = min(cores, int(os.environ.get("OMP_NUM_THREADS", cores)))
    return max(1, min(cores, MOST))


def use_threads(number: int) -> None:
    """Sets how many threads this process and those that it starts use, at most. libigl reads it when it is loaded."""
    for name in ("OMP_NUM_THREADS", "IGL_NUM_THREADS"):
        os.environ[name] = str(number)


def cut_evenly(count: int, most: int) -> list[slice]:
    """Slices of ``most`` items that together are the first ``count``; one empty slice for none."""
    return [slice(start, start + most) for start in range(0, max(count, 1), most)]


def map_in_threads(function: Callable[[Item], Value], items: Iterable[Item]) -> list[Value]:
    """What a function gives for each of the items, in their order.

    The items must not depend on the number of threads, so that the result is the same on one core and on eight.
    """
    every, threads = list(items), count_threads()
    if threads == 1 or len(every) < 2:
        return [function(item) for item in every]
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(min(threads, len(every))) as pool:
        return list(pool.map(function, every))
