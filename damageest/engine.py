"""Calls stages: what they take by name, what they gave before, who watches, and what went wrong."""

from __future__ import annotations

import time
import typing
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from damageest.artefacts import ArtefactError
from damageest.cache import Cache, digest
from damageest.contracts import Contract
from damageest.errors import DamageestError, InputError, StageError
from damageest.job import Job
from damageest.registry import Implementation, Registry
from damageest.result import StageRecord


@dataclass(frozen=True, eq=False)
class State:
    """What is known so far: values by name, and for each the key that says how it came about. ``site`` 0: the job."""

    values: Mapping[str, Any]
    keys: Mapping[str, str]
    site: int = 0

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def add(self, name: str, value: Any, key: str) -> State:
        return State({**self.values, name: value}, {**self.keys, name: key}, self.site)

    def derive(self, name: str, value: Any, *sources: str) -> State:
        """Adds a value that follows from ``sources`` and the site alone."""
        return self.add(name, value, digest(name, self.site, [self.keys[source] for source in sources]))

    def at(self, site: int) -> State:
        return State(self.values, self.keys, site)


@dataclass
class Engine:
    """One run of a job. ``records`` and ``failures`` grow as it goes; ``stems`` are the cache entries it used,
    ``whole`` the state of the job as it was when the work was split up by sites."""

    job: Job
    registry: Registry
    cache: Cache | None = None
    records: list[StageRecord] = field(default_factory=list)
    failures: list[StageError] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    stems: list[str] = field(default_factory=list)
    memo: dict[str, Any] = field(default_factory=dict)
    whole: State = field(default_factory=lambda: State({}, {}))

    def call(self, contract: Contract, state: State) -> State:
        """Runs the job's implementation of a contract on a state, or takes what it gave before on the same."""
        if contract in self.job.given:
            value = self.job.given[contract]
            return state.add(contract.gives, value, digest(value))
        stage, item = self.job.stages[contract], self.job.implementations[contract]
        hooks, where = self.registry.hooks.hook, (contract.stage, item.name, state.site)
        named = dict(zip(("stage", "use", "site"), where, strict=True))
        needs = item.cls.needs()
        key = digest(*where[:2], item.provider.fingerprint, stage.model_dump(), [state.keys[name] for name in needs])
        _tell(hooks.damageest_before_stage, **named)
        start = time.perf_counter()
        try:
            cached, value = self.remember(
                contract.stage + (f"-{state.site}" if state.site else ""),
                key,
                lambda: _checked(stage.run(**{name: state[name] for name in needs}), contract),  # type: ignore[attr-defined]
                keep=contract.stage != "export",
            )
        except Exception as error:
            _tell(hooks.damageest_stage_failed, **named, error=error)
            raise _placed(error, item, state.site) from error
        seconds = time.perf_counter() - start
        self.records.append(StageRecord(*where[:2], str(item.provider), state.site, round(seconds, 3), cached))
        _tell(hooks.damageest_after_stage, **named, output=value, seconds=seconds, cached=cached)
        return state.add(contract.gives, value, key)

    def remember(self, name: str, key: str, compute: Callable[[], Any], keep: bool = True) -> tuple[bool, Any]:
        """(was it there, value): from this run's memory, else from the cache, else computed and kept."""
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


Joint = Callable[[Engine, list[State]], list[State]]
Route = tuple[Contract | Joint, ...]


def follow(route: Sequence[Contract | Joint], engine: Engine, lanes: list[State]) -> list[State]:
    """Runs a route. A site whose stage fails is set aside in ``engine.failures``; the others go on.

    A lane is the state of one line of work: the whole job at first, then one site each, then the whole job again. A
    contract is called once on each lane; a joint takes all lanes and gives the next ones.
    """
    for step in route:
        if not isinstance(step, type):
            lanes = step(engine, lanes)
            continue
        ahead = []
        for lane in lanes:
            try:
                ahead.append(engine.call(step, lane))
            except StageError as error:
                if not lane.site:
                    raise
                engine.failures.append(error)
        lanes = ahead
    return lanes


def _tell(hook: Callable[..., Any], **what: Any) -> None:
    """Calls observers. One that fails has no say in what is computed, nor in whether it is."""
    try:
        hook(**what)
    except Exception as error:
        text = f"a plugin that observes stage {what['stage']} failed: {type(error).__name__}: {error}"
        warnings.warn(text, RuntimeWarning, stacklevel=2)


def _checked(value: Any, contract: Contract) -> Any:
    """The value, if it is of the type that the contract promises."""
    expected = typing.get_type_hints(contract.run)["return"]  # type: ignore[attr-defined]
    kinds = typing.get_args(expected) or (expected,)
    kinds = (tuple,) if typing.get_origin(expected) is tuple else kinds
    if not isinstance(value, kinds):
        names = " or ".join(getattr(kind, "__name__", str(kind)) for kind in kinds)
        raise StageError(
            f"gave a {type(value).__name__} where its contract promises {names}", "update the plugin that it is from"
        )
    return value


def _placed(error: Exception, item: Implementation, site: int) -> DamageestError:
    """The error with the stage it came from; what is no error of ours becomes one that says whose it is."""
    stage = item.contract.stage
    if isinstance(error, DamageestError) and not isinstance(error, StageError):
        return error
    if isinstance(error, OSError) and stage in ("part", "scan"):
        return InputError(f"{stage}: {item.name}: {error}")
    placed = error if isinstance(error, StageError) else _explained(error, f"{item.provider}")
    placed.stage, placed.use, placed.site = stage, item.name, site
    return placed


def _explained(error: Exception, provider: str) -> StageError:
    """An error that a stage did not raise on purpose, in words for whoever uses or mends it."""
    first = str(error).splitlines()[0][:400] if str(error) else ""
    if isinstance(error, MemoryError):
        return StageError("ran out of memory", "a larger tolerance, or fewer scan points")
    if isinstance(error, ArtefactError):
        return StageError(
            f"gave an artefact that is none: {first}", f"another implementation; tell those of {provider}"
        )
    if isinstance(error, ValueError) and "read-only" in first:
        return StageError(
            f"tried to edit what it was given, which later stages use as well ({first})",
            f"another implementation; those of {provider} should edit a copy",
        )
    return StageError(
        f"failed unexpectedly: {type(error).__name__}: {first}",
        f"--debug for the traceback; a report to those of {provider}, with job and inputs, would help to mend it",
    )
