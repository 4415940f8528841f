"""The Dask cluster that a batch runs on: workers of this machine, or a running one by its address."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import sys
import threading
from collections.abc import Iterator
from multiprocessing import resource_tracker
from pathlib import Path
from typing import Any

from damageest.errors import InputError, StageError, describe_install
from damageest.geometry.threads import count_cores

CONNECT_SECONDS = 30
"""Longest time until a scheduler answers."""


_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "IGL_NUM_THREADS")
"""Variables with the number of threads of numerical libraries: the jobs share the cores."""


def require_dask() -> None:
    """Raises InputError where Dask is missing."""
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            f"damageest batch needs dask distributed, which is not installed\n  try: {describe_install('batch')}"
        ) from None


@contextlib.contextmanager
def open_client(scheduler: str, workers: int, processes: bool = True) -> Iterator[Any]:
    """A client of the scheduler at this address, or of new local workers, each a process with one thread; or without
    ``processes`` of as many threads of this process, for work that starts a process itself.

    A job is tried again by the batch, not by Dask. Raises InputError where no scheduler answers.
    """
    import dask
    from distributed import Client, LocalCluster  # before the settings, which else would take its defaults with them

    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what happens to workers is in the table
    threads = str(max(1, count_cores() // workers))
    environment = {name: os.environ.get(name, threads) for name in _THREADS}
    chosen = {"distributed.scheduler.allowed-failures": 0, "distributed.nanny.pre-spawn-environ": environment}
    with dask.config.set(chosen):
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
        size = {"n_workers": workers if processes else 1, "threads_per_worker": 1 if processes else workers}
        # any free port: a second batch would warn that the default one is in use
        fixed: dict[str, Any] = {"memory_limit": 0, "dashboard_address": "127.0.0.1:0", "silence_logs": 50}
        with contextlib.ExitStack() as stack:
            with _keep_interrupts():
                try:
                    cluster = stack.enter_context(LocalCluster(processes=processes, **size, **fixed))
                    client = stack.enter_context(Client(cluster))
                except RuntimeError as error:
                    if script := find_unguarded():
                        raise InputError(
                            f"batch: its worker processes read {script} again, which calls it again\n"
                            '  try: call damageest.batch below  if __name__ == "__main__":'
                        ) from None
                    raise StageError(
                        f"batch: a worker process did not start ({error})",
                        "fewer --workers; more free memory; `damageest run` needs no worker",
                        code="memory",
                    ) from None
            yield client


def find_unguarded() -> str:
    """The script of this process where nothing in it depends on whether a process was started with it, or reads it
    again; empty elsewhere."""
    file = getattr(sys.modules.get("__main__"), "__file__", None)
    if not file or Path(file).name == "__main__.py":  # which is not read again
        return ""
    try:
        return "" if "__main__" in Path(file).read_text(encoding="utf-8", errors="replace") else str(file)
    except OSError:
        return ""


@contextlib.contextmanager
def _keep_interrupts() -> Iterator[None]:
    """Ctrl-C waits until the block has ended, and processes that are started in it never get it: Dask's workers would
    print tracebacks, where this process ends them anyhow.

    A program inherits that a signal is ignored. A signal that is blocked as well is kept, on Linux, until it is
    unblocked, and then meets the handler of that moment.
    """
    if not hasattr(signal, "pthread_sigmask") or threading.current_thread() is not threading.main_thread():
        yield
        return
    resource_tracker.ensure_running()  # it unblocks the signal, if it is started later
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
