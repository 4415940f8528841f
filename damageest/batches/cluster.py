"""The Dask cluster that a batch runs on: workers of this machine, or a running one by its address."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from typing import Any

from damageest.errors import InputError

CONNECT_SECONDS = 30
"""Longest time until a scheduler answers."""


def require_dask() -> None:
    """Raises InputError where Dask is missing."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "damageest batch needs dask distributed, which is not installed\n  try: pip install 'damageest[batch]'"
        ) from None


def count_cores() -> int:
    """The cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextlib.contextmanager
def open_client(scheduler: str, workers: int) -> Iterator[Any]:
    """A client of the scheduler at this address, or of new local workers, each a process with one thread.

    A job is tried again by the batch, not by Dask. Raises InputError where no scheduler answers.
    """
    import dask

    chosen = {"distributed.scheduler.allowed-failures": 0}
    quiet = {"logging.distributed": "critical"}  # what happens to workers is in the table
    with dask.config.set({**chosen, **quiet}):
        from distributed import Client, LocalCluster

        if scheduler:
            try:
                client = Client(scheduler, timeout=CONNECT_SECONDS)
            except (OSError, ValueError) as error:
                raise InputError(
                    f"--scheduler: no Dask scheduler answers at {scheduler} ({error})\n"
                    "  try: dask scheduler  there, and the address that it prints, as tcp://host:8786"
                ) from None
            with client:
                yield client
            return
        # the limit of memory is the job's process' own, so Dask's, which restarts workers, is off
        with (
            LocalCluster(
                n_workers=workers, threads_per_worker=1, memory_limit=0, dashboard_address=None, silence_logs=50
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client
