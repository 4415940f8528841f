"""Calls stages: what they take by name, what they gave before, who observes, and what went wrong."""

from __future__ import annotations

import time
import typing
import warnings
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, TypeVar

from damageest.artefacts import ArtefactError
from damageest.errors import StageError, clean_message, describe_shortage, is_interrupt
from damageest.isolation import Limits, at_work, listen
from damageest.isolation.lost_threads import raise_lost
from damageest.job.model import Job
from damageest.pipeline.cache import digest
from damageest.pipeline.calls import call_guarded, run_stage
from damageest.pipeline.near_damage import sample_near_damage
from damageest.pipeline.stage_errors import locate_error
from damageest.pipeline.state import Candidate, FoundSite, JobState, list_given
from damageest.pipeline.steps import GATHERED, Step
from damageest.registry.contracts import DEFAULTS, Contract
from damageest.registry.guards import name_observer
from damageest.registry.outputs import check_output
from damageest.registry.registry import Registry
from damageest.result import StageRecord, StepRecord
from damageest.rules.notes import make_notes
from damageest.stages.cluster import Cluster
from damageest.stages.sample import Sample
from damageest.stages.segment import Segment

TELLING = (Segment, Cluster)
"""The contracts of a route whose notes are those of the run."""

S = TypeVar("S", JobState, Candidate, FoundSite)
T = TypeVar("T")


class Store(Protocol):
    """Where the values of stages are kept from run to run: in files, or in memory."""

    def get(self, name: str, key: str) -> tuple[bool, Any]: ...

    def put(self, name: str, key: str, value: Any) -> None: ...


@dataclass
class Engine:
    """One run of a job. ``records`` of stages and ``steps`` grow as it goes; ``stems`` are the cache entries that it
    used. ``silent``: it calls stages on values that are not the job's own, and observers do not get these calls.
    ``limits``: of each stage, of memory for those that run in a process of their own. ``last``: the state after the
    last item of the route that came to its end."""

    job: Job
    registry: Registry
    cache: Store | None = None
    records: list[StageRecord] = field(default_factory=list)
    steps: list[StepRecord] = field(default_factory=list)
    stems: list[str] = field(default_factory=list)
    memo: dict[str, Any] = field(default_factory=dict)
    silent: bool = False
    limits: Limits = field(default_factory=Limits)
    last: JobState | None = None

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
        """Runs the job's implementation of a contract on a state, or takes what it gave before on the same. Points on
        the skin that it takes are made for it."""
        if contract in self.job.given:
            value = self.job.given[contract]
            return state.with_named(contract.gives, value, digest(value))
        stage, item = self.job.stages[contract], self.job.implementations[contract]
        hooks, where = self.registry.hooks.hook, (contract.stage, item.name, state.number)
        named = dict(zip(("stage", "use", "site"), where, strict=True))
        needs, taken = item.cls.needs(), self.fill(item.cls.needs(), state)
        key = digest(self.describe(contract), [taken.key(name) for name in needs])
        tell = _tell_nobody if self.silent else _tell
        tell(hooks.damageest_before_stage, **named)
        start = time.perf_counter()
        try:
            with listen(lambda what: tell(hooks.damageest_part_begins, **named, what=what)):
                cached, value = self.remember(
                    contract.stage + (f"-{state.number}" if state.number else ""),
                    key,
                    lambda: _check_value(
                        run_stage(stage, item, {name: taken.get(name) for name in needs}, self.limits, state.number),
                        contract,
                        state,
                    ),
                    keep=contract.stage not in ("export", "report"),
                )
        except Exception as error:
            if is_interrupt(error):
                raise KeyboardInterrupt from error
            tell(hooks.damageest_stage_failed, **named, error=error)
            raise locate_error(error, item, state) from error
        seconds = time.perf_counter() - start
        self.records.append(StageRecord(*where[:2], str(item.provider), state.number, round(seconds, 3), cached))
        tell(hooks.damageest_after_stage, **named, output=value, seconds=seconds, cached=cached)
        return state.with_named(contract.gives, value, key)

    def fill(self, needs: Collection[str], state: S) -> S:
        """The state with those points on the skin that an implementation ``needs`` and the state has not: they are
        made once for a part and a tolerance, and not at all where nothing takes them."""
        job = state if isinstance(state, JobState) else state.job
        if "samples" in needs and job.samples is None:
            key = digest(self.describe(Sample), [job.key(name) for name in self.needs(Sample)])
            made = job.with_named("samples", self.memo[key], key) if key in self.memo else self.call(Sample, job)
            state = state.with_named("samples", made.samples, made.key("samples"))
        if "nearby" in needs and job.nearby is None:
            made = self.take(sample_near_damage, job)
            state = state.with_named("nearby", made.nearby, made.key("nearby"))
        return state

    def needs(self, contract: Contract) -> tuple[str, ...]:
        """What the job's implementation of a contract takes."""
        return tuple(self.job.implementations[contract].cls.needs())

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
            raise locate_error(error, item, JobState()) from error
        return value

    def take(self, step: Step[..., Any], state: JobState) -> JobState:
        """The state after a step. What it gives has the key of its content where that is a plain value, and else one
        of the keys of what it took; what it hands on as it was keeps its key.

        Raises StageError where memory runs out in it.
        """
        what, called, start = step.name.replace("_", " ").strip(), len(self.records), time.perf_counter()
        key = digest(step.name, [state.key(name) for name in step.takes], [self.describe(one) for one in step.calls])
        try:
            with at_work(what, self.limits.seconds):
                _, given = self.remember(step.name, key, lambda: self._run(step, state), step.kept)
        except (MemoryError, RuntimeError) as error:
            short = describe_shortage(error)
            if short is None:
                raise
            raise StageError(f"{what}: {short.message}", short.remedy, code="memory") from None
        seconds = time.perf_counter() - start - sum(record.seconds for record in self.records[called:])
        self.steps.append(StepRecord(step.name, round(seconds, 3)))
        _tell(self.registry.hooks.hook.damageest_after_step, step=what, seconds=seconds)
        for name, value in step.name_values(given).items():
            earlier = ""
            if name in GATHERED:
                value = (*(() if name in list_given(step.takes) else state.get(name)), *value)
                earlier = state.key(name)
            if name not in state.values or value is not state.get(name):
                is_plain = value is None or isinstance(value, (bool, int, float, str))
                state = state.with_named(name, value, digest(value) if is_plain else digest(key, name, earlier))
        return state

    def _run(self, step: Step[..., Any], state: JobState) -> Any:
        own = {"engine": self, "state": state.select(step.takes)}
        with raise_lost():
            return step.function(**{name: own[name] if name in own else state.get(name) for name in step.passed})

    def describe(self, contract: Contract) -> str:
        """A key of the job's implementation of a contract with all its options; the same for each job without one."""
        if contract not in self.job.stages:
            return digest(contract.stage)
        item = self.job.implementations[contract]
        points = self.describe(Sample) if "samples" in item.cls.needs() and contract is not Sample else ""
        options = self.job.stages[contract].model_dump()
        return digest(points, contract.stage, item.name, item.provider.fingerprint, options)

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


@dataclass(frozen=True)
class Branch:
    """A place where the route forks: ``run`` follows some of the ``routes``, or none. ``reads``: the names of the
    values that it chooses by."""

    name: str
    reads: tuple[str, ...]
    routes: tuple[Route, ...]
    run: Callable[[Engine, JobState], JobState]


AnyStep = Step[..., Any] | Branch
Route = tuple[Contract | AnyStep, ...]


def follow(route: Route, engine: Engine, state: JobState) -> JobState:
    """Runs a route: a contract once on the job, or once on each candidate; a step on the values that it names.

    A candidate whose stage fails becomes one of the ``failures``; the others go on.
    """
    for item in route:
        if isinstance(item, Branch):
            state = item.run(engine, state)
        elif isinstance(item, Step):
            state = engine.take(item, state)
        elif item.per_site:
            state = call_each(engine, item, state)
        else:
            state = engine.call(item, state)
            if item in TELLING:
                told = (*state.warnings, *make_notes(item.stage, state.get(item.gives).notes))
                state = state.with_value(JobState.warnings, told, digest(state.key("warnings"), state.key(item.gives)))
        if not engine.silent:
            engine.last = state
    return state


def call_each(engine: Engine, contract: Contract, state: JobState) -> JobState:
    """The state with a contract called on each candidate."""
    done: list[Candidate] = []
    failures = []
    for candidate in state.candidates:
        try:
            done.append(engine.call(contract, replace(candidate, job=state)))
        except StageError as error:
            failures.append(error)
    key = digest(contract.stage, [candidate.key(contract.gives) for candidate in done], state.key("candidates"))
    state = state.with_value(JobState.failures, (*state.failures, *failures), key)
    return state.with_value(JobState.candidates, tuple(replace(one, job=JobState()) for one in done), key)


def _tell(hook: Callable[..., Any], **what: Any) -> None:
    """Calls observers. A failing one becomes a warning: it changes nothing of what is computed."""
    try:
        hook(**what)
    except BaseException as error:
        if is_interrupt(error):
            raise KeyboardInterrupt from error
        of = f"stage {what['stage']}" if "stage" in what else f"step {what['step']}"
        who, said = name_observer(hook, error), f"failed: {type(error).__name__}: {clean_message(error, 400)}"
        warnings.warn(f"{who}, which observes {of}, {said}", RuntimeWarning, stacklevel=2)


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
