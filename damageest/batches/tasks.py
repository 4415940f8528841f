"""Tasks on a Dask cluster: each one ends with a result or a reason, also where workers die."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass
from typing import Any

TRIES = 2
"""How many workers a task is given to, one after the other, where they die."""
POLL = 0.5
"""Seconds between two looks at the tasks."""
_LOST = "the cluster ended"


@dataclass(frozen=True)
class Ended:
    """A task that has ended. ``value``: what the function gave; None if there is none, and then
    ``why`` says why. ``tries``: how many workers it was given to."""

    name: str
    value: Any
    why: str
    tries: int


def run_tasks(
    client: Any, function: Callable[..., Any], tasks: Mapping[str, tuple[Any, ...]], token: str
) -> Generator[tuple[list[Ended], set[str]], None, None]:
    """Calls ``function`` with the arguments of each task, and gives, at least every `POLL` seconds, those that have
    ended since and the names of those that a worker has.

    ``function`` catches its own exceptions: one that it raises counts as the death of its worker. ``token`` begins the
    keys in Dask. Dask gets as many tasks as it has threads: one that waits on a worker would count as tried where
    that worker dies. Where it is closed, tasks are cancelled.
    """
    tries = dict.fromkeys(tasks, 0)
    waiting = list(tasks)[::-1]
    futures: dict[Any, str] = {}
    threads, counted = 1, -math.inf
    try:
        while waiting or futures:
            if client.status in ("closing", "closed"):  # its scheduler ended, and none took its place
                yield [Ended(name, None, _LOST, tries[name]) for name in (*futures.values(), *waiting)], set()
                break
            if time.monotonic() > counted + POLL:  # workers come and go
                with contextlib.suppress(OSError):  # the scheduler is gone: Dask looks for it
                    threads = max(1, sum(client.nthreads().values()))
                counted = time.monotonic()
            while waiting and len(futures) < threads:
                name = waiting.pop()
                tries[name] += 1
                key = f"{token}-{name}-{tries[name]}"
                futures[client.submit(function, *tasks[name], key=key, pure=False)] = name
            done = {futures[future]: future for future in _wait(list(futures))}
            finished = {name: future for name, future in done.items() if future.status == "finished"}
            # None for one whose worker died since; where Dask has it run again elsewhere, this waits for it
            values = client.gather(finished, errors="skip") if finished else {}
            ended = []
            for name, future in done.items():
                del futures[future]
                if values.get(name) is not None:
                    ended.append(Ended(name, values[name], "", tries[name]))
                elif future.status != "error":
                    ended.append(Ended(name, None, _LOST, tries[name]))
                elif tries[name] < TRIES:
                    waiting.append(name)
                    counted = -math.inf  # fewer workers now: with one task more than threads, one would wait
                else:
                    ended.append(Ended(name, None, f"{tries[name]} workers died with it", tries[name]))
            yield ended, set(futures.values())
    finally:
        if futures:
            with contextlib.suppress(Exception):  # a cluster that has ended
                client.cancel(list(futures), force=True)


def _wait(futures: list[Any]) -> list[Any]:
    """The futures that are done, after at most `POLL` seconds."""
    from distributed import wait

    with contextlib.suppress(TimeoutError, CancelledError):  # cancelled, where the scheduler ended
        wait(futures, timeout=POLL, return_when="FIRST_COMPLETED")
    return [future for future in futures if future.done()]
