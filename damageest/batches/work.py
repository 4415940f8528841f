"""What a worker does: one job, in a process of its own, as a row."""

from __future__ import annotations

import contextlib
import functools
import os
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from damageest.batches.jobs import MATRIX
from damageest.batches.page import keep_picture
from damageest.batches.rows import describe_result
from damageest.errors import DamageestError, StageError, clean_message, describe_error
from damageest.isolation import Limits, ProcessError, Usage, call_isolated, end_workers, find_place
from damageest.job import Job, load
from damageest.pipeline.cache import digest
from damageest.registry import Registry
from damageest.registry.hookspecs import hookimpl
from damageest.stages.report import ReportFiles

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
    limits = Limits(task["memory"], task["timeout"], of="job", option="--timeout")
    process = f"{task['batch']} {threading.get_ident()}"

    def tell(usage: Usage) -> None:
        row["megabytes"] = usage.megabytes

    try:
        with _end_if_unwanted(process):
            done = call_isolated(
                run_job, {"task": task}, worker=process, limits=limits, show=False, nested=True, tell=tell
            )
    except ProcessError as error:
        what = find_place(error)
        done = {"outcome": _OUTCOMES[error.why], "error": f"{what}: {error.message}" if what else error.message}
    except BaseException as error:  # also an interrupt: Ctrl-C reaches the batch, not this thread of a worker
        done = {"outcome": "failed", "error": f"{type(error).__name__}: {' '.join(clean_message(error, 400).split())}"}
    return row | done | {"seconds": round(time.perf_counter() - start, 3)}


def release(batch: str) -> None:
    """Ends the processes of a batch on this worker."""
    end_workers(batch)


def run_job(task: dict[str, Any]) -> dict[str, Any]:
    """Runs in the job's process: gives the fields of the row that the job decides."""
    from damageest.api import run

    key = ""
    try:
        registry, pictures = _discover()
        pictures.last = b""
        job = load_job(task["job"], task["settings"], registry)
        key = compute_key(job, registry)
        limits = Limits(task["memory"], task["stage_timeout"])
        result = run(job, output=task["output"], cache=task["cache"], registry=registry, limits=limits)
        keep_picture(Path(task["output"]), pictures.last)
        done = describe_result(result)
    except MemoryError:
        raise
    except DamageestError as error:
        outcome = "failed" if isinstance(error, StageError) else "refused"
        outcome = _OUTCOMES.get(getattr(error, "why", ""), outcome) if outcome == "failed" else outcome
        done = {"outcome": outcome, "error": describe_error(error)}
    return done | {"key": key}


def load_job(path: str, settings: list[str] | tuple[str, ...], registry: Registry) -> Job:
    """The job of a row. Raises JobError for one that is not valid."""
    return load(path, registry, settings, without=(MATRIX,))


def compute_key(job: Job, registry: Registry) -> str:
    """A digest of the job with all its options, of the content of its files, and of the code."""
    stages = {c.stage: [job.implementations[c].name, stage.model_dump()] for c, stage in job.stages.items()}
    fixed = [job.name, job.units, job.tolerance, job.method, job.sites.model_dump(), job.accept]
    return digest(stages, fixed, sorted(provider.fingerprint for provider in registry.providers))


class _Pictures:
    """Takes the picture of a run from its report."""

    def __init__(self) -> None:
        self.last = b""

    @hookimpl
    def damageest_after_stage(self, stage: str, output: object) -> None:
        if stage == "report" and isinstance(output, ReportFiles):
            self.last = output.picture


@functools.cache
def _discover() -> tuple[Registry, _Pictures]:
    """All that is installed, and what observes it; once for each process, which runs many jobs."""
    pictures = _Pictures()
    return Registry.discover([pictures]), pictures


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
