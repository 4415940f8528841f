"""Calls stages: what they take by name, what they gave before, who observes, and what went wrong."""

from __future__ import annotations

import time
import typing
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from damageest.artefacts import ArtefactError
from damageest.errors import (
    DamageestError,
    InputError,
    JobError,
    StageError,
    clean_message,
    describe_missing_library,
    is_interrupt,
)
from damageest.isolation import Limits, at_work
from damageest.job.model import Job
from damageest.pipeline.cache import Cache, describe_unwritable, digest
from damageest.pipeline.calls import call_guarded, run_stage
from damageest.pipeline.state import Candidate, FoundSite, JobState, Work
from damageest.registry.contracts import DEFAULTS, Contract
from damageest.registry.outputs import check_output
from damageest.registry.registry import Implementation, Registry
from damageest.result import StageRecord
from damageest.stages import Stage

MORE_MEMORY = "a larger tolerance, fewer scan points (scan.most_points), or a larger --memory"

S = TypeVar("S", JobState, Candidate, FoundSite)
T = TypeVar("T")


@dataclass
class Engine:
    """One run of a job. ``records`` grow as it goes; ``stems`` are the cache entries that it used. ``silent``: it
    calls stages on values that are not the job's own, and observers do not get these calls. ``limits``: of each stage,
    of memory for those that run in a process of their own."""

    job: Job
    registry: Registry
    cache: Cache | None = None
    records: list[StageRecord] = field(default_factory=list)
    stems: list[str] = field(default_factory=list)
    memo: dict[str, Any] = field(default_factory=dict)
    silent: bool = False
    limits: Limits = field(default_factory=Limits)

    def make_silent(self, *contracts: Contract) -> Engine:
        """An engine for calls of stages on other values than the job's own: with the same cache, without records.

        ``contracts``: those that have their default implementation where the job's route has none of them.
        """
        stages, items = dict(self.job.stages), dict(self.job.implementations)
        for contract in contracts:
            if contract not in stages:
                item = self.registry.get(contract.stage, DEFAULTS[contract])
                stages[contract], items[contract] = item.cls.model_validate({}), item
        return replace(self, job=replace(self.job, stages=stages, implementations=items), records=[], silent=True)

    def call(self, contract: Contract, state: S) -> S:
        """Runs the job's implementation of a contract on a state, or takes what it gave before on the same."""
        if contract in self.job.given:
            value = self.job.given[contract]
            return state.with_named(contract.gives, value, digest(value))
        stage, item = self.job.stages[contract], self.job.implementations[contract]
        hooks, where = self.registry.hooks.hook, (contract.stage, item.name, state.number)
        named = dict(zip(("stage", "use", "site"), where, strict=True))
        needs = item.cls.needs()
        key = digest(*where[:2], item.provider.fingerprint, stage.model_dump(), [state.key(name) for name in needs])
        tell = _tell_nobody if self.silent else _tell
        tell(hooks.damageest_before_stage, **named)
        start = time.perf_counter()
        try:
            cached, value = self.remember(
                contract.stage + (f"-{state.number}" if state.number else ""),
                key,
                lambda: _check_value(
                    run_stage(stage, item, {name: state.get(name) for name in needs}, self.limits, state.number),
                    contract,
                    state,
                ),
                keep=contract.stage not in ("export", "report"),
            )
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            tell(hooks.damageest_stage_failed, **named, error=error)
            raise _locate(error, item, state) from error
        seconds = time.perf_counter() - start
        self.records.append(StageRecord(*where[:2], str(item.provider), state.number, round(seconds, 3), cached))
        tell(hooks.damageest_after_stage, **named, output=value, seconds=seconds, cached=cached)
        return state.with_named(contract.gives, value, key)

    def ask(self, contract: Contract, function: Callable[[], T], kind: type) -> T:
        """What another method of the job's implementation gives than ``run``; of the type ``kind``.

        Raises as `call` does: an error says the stage and whose code it is.
        """
        item = self.job.implementations[contract]
        try:
            value = call_guarded(function, f"{item.provider}")
            if not isinstance(value, kind):
                raise ArtefactError(f"expected {kind.__name__}, got {type(value).__name__}")
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            raise _locate(error, item, JobState()) from error
        return value

    def remember(self, name: str, key: str, compute: Callable[[], Any], keep: bool = True) -> tuple[bool, Any]:
        """(was it known, value): from this run's memory, else from the cache, else computed and kept."""
        if key in self.memo:
            return True, self.memo[key]
        found, value = self.cache.get(name, key) if self.cache and keep else (False, None)
        if not found:
            value = compute()
            if self.cache and keep:
                self.cache.put(name, key, value)
        if keep:
            self.memo[key] = value
            self.stems.append(f"{name}-{key}")
        return found, value


Step = Callable[[Engine, Work], Work]
Route = tuple[Contract | Step, ...]


def follow(route: Sequence[Contract | Step], engine: Engine, work: Work) -> Work:
    """Runs a route: a contract once on the job, or once on each candidate; a step on all of the work.

    A candidate whose stage fails leaves the work as one of its ``failures``; the others go on.
    """
    for step in route:
        if not isinstance(step, type):
            work = _take(step, engine, work)
        elif issubclass(step, Stage) and step.per_site:
            work = call_each(engine, step, work)
        else:
            work = replace(work, job=engine.call(step, work.job))
    return work


def _take(step: Step, engine: Engine, work: Work) -> Work:
    """The work after a step. Raises StageError where memory runs out in it."""
    what = step.__name__.replace("_", " ").strip()
    try:
        with at_work(what, engine.limits.seconds):
            return step(engine, work)
    except MemoryError:
        raise StageError(f"{what}: ran out of memory", MORE_MEMORY) from None


def call_each(engine: Engine, contract: Contract, work: Work) -> Work:
    """The work with a contract called on each candidate."""
    done: list[Candidate] = []
    failures = []
    for candidate in work.candidates:
        try:
            done.append(engine.call(contract, candidate))
        except StageError as error:
            failures.append(error)
    return replace(work, candidates=tuple(done), failures=(*work.failures, *failures))


def start(job: Job) -> Work:
    """The work before any stage: the job's unit and tolerance."""
    state = JobState().with_value(JobState.unit, job.units, digest(job.units))
    return Work(state.with_named("tolerance", job.tolerance, digest(job.tolerance)))


def _tell(hook: Callable[..., Any], **what: Any) -> None:
    """Calls observers. A failing one becomes a warning: it changes nothing of what is computed."""
    try:
        hook(**what)
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        text = f"a plugin that observes stage {what['stage']} failed: {type(error).__name__}: {clean_message(error)}"
        warnings.warn(text, RuntimeWarning, stacklevel=2)


def _tell_nobody(hook: Callable[..., Any], **what: Any) -> None:
    """For calls that are not the job's own."""


def _check_value(value: Any, contract: Contract, state: JobState | Candidate | FoundSite) -> Any:
    """The value, if it is of the type that the contract promises and fits the stage's inputs."""
    expected = contract.gives_type()
    kinds = typing.get_args(expected) or (expected,)
    kinds = (tuple,) if typing.get_origin(expected) is tuple else kinds
    if not isinstance(value, kinds):
        names = " or ".join(getattr(kind, "__name__", str(kind)) for kind in kinds)
        raise StageError(
            f"gave a {type(value).__name__} where its contract promises {names}", "update the plugin that it is from"
        )
    check_output(contract, value, state.get)
    return value


def _locate(error: Exception, item: Implementation, state: JobState | Candidate | FoundSite) -> DamageestError:
    """The error with the stage it came from. One of another kind becomes a StageError that names the provider."""
    stage = item.contract.stage
    if isinstance(error, JobError):
        return error
    if isinstance(error, DamageestError) and not isinstance(error, StageError):
        error.args = (clean_message(error),)
        return error
    if not isinstance(error, StageError) and (missing := describe_missing_library(error)):
        error = missing
    if isinstance(error, OSError) and stage in ("part", "scan"):
        return InputError(f"{stage}: {item.name}: {clean_message(error)}")
    if isinstance(error, OSError) and stage in ("export", "report") and error.errno:
        return describe_unwritable(error, Path("the output"))
    placed = error if isinstance(error, StageError) else _explain(error, f"{item.provider}")
    placed.message, placed.remedy = clean_message(placed.message), clean_message(placed.remedy)
    placed.stage, placed.use, placed.site = stage, item.name, state.number
    if isinstance(state, Candidate):
        placed.place = describe_points(state.job, state.clusters)
    return placed


def describe_points(state: JobState, clusters: tuple[int, ...]) -> str:
    """A description of where the points of some clusters lie: they have no site number, since they are no site yet."""
    if not {"sites", "aligned"} <= set(state.values):
        return ""
    members = np.flatnonzero(np.isin(state.sites.label, clusters))
    if not len(members):
        return "no points"
    x, y, z = np.median(state.aligned.points[members], axis=0)
    return f"{len(members)} points near ({x:.4g}, {y:.4g}, {z:.4g})"


def _explain(error: Exception, provider: str) -> StageError:
    """An error that a stage did not raise on purpose, in words for the user and the author."""
    first = next(iter(clean_message(error, 400).splitlines()), "")
    if isinstance(error, MemoryError):
        return StageError("ran out of memory", MORE_MEMORY)
    if isinstance(error, ArtefactError):
        return StageError(
            f"gave a result that is not valid: {first}",
            f"another implementation; report it to the authors of {provider}",
        )
    if isinstance(error, ValueError) and "read-only" in first:
        return StageError(
            f"tried to edit what it was given, which later stages use as well ({first})",
            f"another implementation; the authors of {provider} should edit a copy",
        )
    return StageError(
        f"failed unexpectedly: {type(error).__name__}: {first}",
        f"--debug for the traceback; report it to the authors of {provider}, with job and inputs",
    )
