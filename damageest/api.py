"""`damageest.run`: the whole route from Python."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from damageest.errors import InputError
from damageest.io.files import resolve_path, working_folder
from damageest.io.given import as_part, as_scan
from damageest.io.part_store import use_part_store
from damageest.isolation import Limits, keep_one_thread
from damageest.job import Job, load
from damageest.pipeline.begin import start
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, Route, follow
from damageest.pipeline.notebook import find_notebook
from damageest.pipeline.routes import WRITE, route_of
from damageest.pipeline.state import JobState
from damageest.pipeline.watch import MemoryCache, Progress, Signal, Teller, call_with_cancel, keep_so_far
from damageest.pipeline.workspace import open_workspace
from damageest.registry import Registry
from damageest.registry.contracts import Contract
from damageest.result import Result
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan


@keep_one_thread()
def run(
    job: str | Path | Mapping[str, Any] | Job,
    *,
    part: Any = None,
    scan: Any = None,
    output: str | Path | bool = False,
    settings: Sequence[str] | Mapping[str, Any] = (),
    cache: bool | MemoryCache = True,
    registry: Registry | None = None,
    limits: Limits | None = None,
    progress: Callable[[Progress], object] | None = None,
    cancel: Signal | None = None,
) -> Result:
    """Runs a job and gives its result; writes files only with ``output``: a folder, or True for the job's own.

    ``job``: a path, a mapping of the same shape, or a checked Job. ``part`` (`damageest.io.given.PARTS`: of numpy,
    trimesh, PyVista, Open3D) and ``scan`` (`damageest.io.given.SCANS`) replace the job's files; both may also be in the
    mapping. ``settings`` are overrides: ``["cluster.eps=0.4"]``, or ``{"cluster.eps": 0.4}``. Lengths are in the job's
    unit. ``cache``: False computes all anew; a `MemoryCache` keeps outputs of stages from run to run, also without
    files. ``progress`` is called in this thread when a stage or step begins (where it fails, a warning says so, and it
    is not called again); ``cancel``, for example a `threading.Event`, ends the run from another thread. In a notebook a
    run without ``progress`` shows it by itself. ``limits`` of memory and time hold for stages that run in a process of
    their own, those that call a native library. As long as it runs, the linear algebra of numpy and scipy uses one
    thread in this process, so that the same job gives the same bytes on any number of cores.

    Raises JobError or InputError (job or input at fault), StageError (a stage failed or refused) and CancelledError.
    ``so_far`` of the error has the results before it.
    """
    _check_types(cache, progress, cancel)
    registry, limits = registry or Registry.discover(), limits or Limits()
    if not isinstance(job, Job):
        source, given = _split(job, part, scan)
        job = load(source, registry, list_settings(settings), given)
    route = route_of(job.method) if output is False else (*route_of(job.method), *WRITE)
    told = find_notebook() if progress is None else progress
    teller = None if told is None else Teller(told, route)
    found = job
    with _observed(registry, teller):
        result = call_with_cancel(cancel, lambda: _run(found, route, registry, limits, output, cache))
    if teller is not None:
        teller.finish()
    return result


def _run(
    job: Job, route: Route, registry: Registry, limits: Limits, output: str | Path | bool, cache: bool | MemoryCache
) -> Result:
    with use_part_store(bool(cache)):
        memory = cache if isinstance(cache, MemoryCache) else None
        if output is False:
            engine = Engine(job, registry, memory, limits=limits)
            with keep_so_far(engine):
                return follow(route, engine, start(engine)).result
        target = job.output if output is True else resolve_path(Path(output), working_folder())
        job = replace(job, stages={contract: stage.leave_out(target) for contract, stage in job.stages.items()})
        with open_workspace(target, bool(cache)) as place:
            engine = Engine(job, registry, memory or place.cache, limits=limits)
            state = start(engine).with_value(JobState.folder, place.folder, digest(str(target)))
            state = state.with_value(JobState.target, target, digest(str(target)))
            with keep_so_far(engine):
                result = follow(route, engine, state).result
            place.finish(engine.stems)
        return result


@contextmanager
def _observed(registry: Registry, teller: Teller | None) -> Iterator[None]:
    """Lets a caller's observer hear of the run in the ``with`` block, and of no later one."""
    if teller is None:
        yield
        return
    registry.hooks.register(teller)
    try:
        yield
    finally:
        registry.hooks.unregister(teller)


def _check_types(cache: object, progress: object, cancel: object) -> None:
    """Raises InputError before the work for what could fail only in its midst."""
    given = {"cache": cache, "progress": progress, "cancel": cancel}
    wanted = {
        "cache": (isinstance(cache, bool | MemoryCache), "True, False or a damageest.MemoryCache"),
        "progress": (progress is None or callable(progress), "a function of one damageest.Progress"),
        "cancel": (cancel is None or hasattr(cancel, "is_set"), "a threading.Event, or what has is_set()"),
    }
    for name, (is_right, what) in wanted.items():
        if not is_right:
            raise InputError(f"{name}: a {type(given[name]).__name__} cannot be used; give {what}")


def list_settings(settings: Sequence[str] | Mapping[str, Any]) -> Sequence[str]:
    """Overrides in the form of the command line. Raises InputError for a text."""
    if isinstance(settings, str) or not isinstance(settings, Iterable):
        shown = settings if isinstance(settings, str) else "tolerance=0.2"
        raise InputError(f'settings: give a list, [{shown!r}], or a mapping, for example {{"tolerance": 0.2}}')
    if not isinstance(settings, Mapping):
        return settings
    return [f"{name}={value if isinstance(value, str) else json.dumps(value)}" for name, value in settings.items()]


def _split(
    job: str | Path | Mapping[str, Any], part: Any, scan: Any
) -> tuple[str | Path | Mapping[str, Any], dict[Contract, Any]]:
    """The job without its arrays, and the artefacts made from them."""
    source: Any = dict(job) if isinstance(job, Mapping) else job
    units = str(source.get("units", "mm")) if isinstance(source, dict) else "mm"
    if isinstance(source, dict):
        for key, value in source.items():
            if isinstance(value, Path):
                source[key] = str(value)
        part = source.pop("part") if part is None and _is_data(source.get("part")) else part
        scan = source.pop("scan") if scan is None and _is_data(source.get("scan")) else scan
    given: dict[Contract, Any] = {}
    if part is not None:
        given[ReadPart] = as_part(part, units)
    if scan is not None:
        given[ReadScan] = as_scan(scan, units)
    return source, given


def _is_data(value: Any) -> bool:
    """Whether a value of `part` or `scan` holds the data itself rather than the name of a file or an implementation."""
    names_files = isinstance(value, list) and all(isinstance(item, (str, Path)) for item in value)
    return not (value is None or isinstance(value, (str, Path, Mapping)) or names_files)
