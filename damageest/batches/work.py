"""What a worker does: one job, in a process of its own, as a row."""

from __future__ import annotations

import contextlib
import functools
import os
import re
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from damageest.batches.jobs import MATRIX
from damageest.batches.rows import describe_result
from damageest.errors import DamageestError, StageError, clean_message
from damageest.isolation import Limits, ProcessError, call_isolated, end_workers
from damageest.job import Job, load
from damageest.pipeline.cache import digest
from damageest.registry import Registry
from damageest.registry.hookspecs import hookimpl

_STAGE = "@stage "
"""Begins the line that names the stage which a process is in."""
_OUTCOMES = {"time": "timeout", "memory": "memory", "crash": "crashed", "exit": "crashed"}
CHECKED = 1.0
"""Seconds between two looks whether the batch still wants a job."""


def work(task: dict[str, Any]) -> dict[str, Any]:
    """Runs on a Dask worker. ``task``: name, job, settings and output of a row; batch, memory, timeout and
    stage_timeout. Gives the row's values; never raises for what the job does."""
    # Dask sets this for its workers; it makes the allocator return memory at once, and a job take 40 % longer
    os.environ.pop("MALLOC_TRIM_THRESHOLD_", None)
    row = {name: task[name] for name in ("name", "job", "settings", "output")} | {"host": socket.gethostname()}
    start = time.perf_counter()
    limits = Limits(task["memory"], task["timeout"])
    process = f"{task['batch']} {threading.get_ident()}"
    try:
        with _end_if_unwanted(process):
            done = call_isolated(run_job, {"task": task}, worker=process, limits=limits, show=False)
    except ProcessError as error:
        done = {"outcome": _OUTCOMES[error.why], "error": _describe_end(error, limits)}
    except BaseException as error:  # also an interrupt: Ctrl-C reaches the batch, not this thread of a worker
        done = {"outcome": "failed", "error": f"{type(error).__name__}: {' '.join(clean_message(error, 400).split())}"}
    return row | done | {"seconds": round(time.perf_counter() - start, 3)}


def release(batch: str) -> None:
    """Ends the processes of a batch on this worker."""
    end_workers(batch)


def run_job(task: dict[str, Any]) -> dict[str, Any]:
    """Runs in the job's process: gives the fields of the row that the job decides."""
    from damageest.api import run
    from damageest.isolation import serve

    serve.is_worker = False  # a stage that calls a native library has a process of its own also here
    _reset_peak()
    key = ""
    try:
        registry = _discover()
        job = load_job(task["job"], task["settings"], registry)
        key = compute_key(job, registry)
        limits = Limits(task["memory"], task["stage_timeout"])
        result = run(job, output=task["output"], cache=task["cache"], registry=registry, limits=limits)
        done = describe_result(result)
    except MemoryError:
        raise
    except DamageestError as error:
        outcome = "failed" if isinstance(error, StageError) else "refused"
        outcome = _OUTCOMES.get(getattr(error, "why", ""), outcome) if outcome == "failed" else outcome
        done = {"outcome": outcome, "error": " ".join(str(error).split())}
    return done | {"key": key, "megabytes": _read_peak()}


def load_job(path: str, settings: list[str] | tuple[str, ...], registry: Registry) -> Job:
    """The job of a row. Raises JobError for one that is not valid."""
    return load(path, registry, settings, without=(MATRIX,))


def compute_key(job: Job, registry: Registry) -> str:
    """A digest of the job with all its options, of the content of its files, and of the code."""
    stages = {c.stage: [job.implementations[c].name, stage.model_dump()] for c, stage in job.stages.items()}
    fixed = [job.name, job.units, job.tolerance, job.method, job.sites.model_dump(), job.accept]
    return digest(stages, fixed, sorted(provider.fingerprint for provider in registry.providers))


class _NameStage:
    """Prints each stage as it begins, so that a crash can be told where it was."""

    @hookimpl
    def damageest_before_stage(self, stage: str, use: str, site: int) -> None:
        sys.stderr.write(f"{_STAGE}{stage}: {use}{f' (site {site})' if site else ''}\n")
        sys.stderr.flush()


@functools.cache
def _discover() -> Registry:
    """All that is installed; once for each process, which runs many jobs."""
    return Registry.discover([_NameStage()])


def _describe_end(error: ProcessError, limits: Limits) -> str:
    """What ended a job's process, with the stage that it was in."""
    late = f"not finished after {limits.seconds:g} s (--timeout)"
    text = late if error.why == "time" else error.message
    stages = re.findall(rf"^{_STAGE}(.*)$", str(error.__cause__ or ""), re.MULTILINE)
    return f"{stages[-1]}: {text}" if stages else text


@contextlib.contextmanager
def _end_if_unwanted(process: str) -> Iterator[None]:
    """Ends the job's process where its batch was interrupted. Dask itself does not end what runs already."""
    from distributed.worker import get_worker, thread_state

    try:
        worker, key = get_worker(), thread_state.key
    except (ValueError, AttributeError):  # not on a worker
        yield
        return
    over = threading.Event()

    def watch() -> None:
        while not over.wait(CHECKED):
            task = worker.state.tasks.get(key)
            if task is None or task.state in ("cancelled", "released", "forgotten"):
                end_workers(process)
                return

    thread = threading.Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def _reset_peak() -> None:
    """Begins a new peak of memory: the process has run other jobs."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _read_peak() -> float | None:
    """The peak of this process in MB; None where the system does not tell."""
    try:
        found = re.search(r"^VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text(), re.MULTILINE)
    except OSError:
        return None
    return round(int(found[1]) / 1024) if found else None
