"""What the engine makes of stages: the right ones again, errors with their place, watchers that cannot spoil a run."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import Field

import damageest
from damageest.errors import DamageestError, InputError, StageError
from damageest.io.meshes import write_points
from damageest.job import Job, load
from damageest.pipeline.cache import Cache
from damageest.pipeline.engine import Engine, follow
from damageest.pipeline.state import Candidate, FoundSite, JobState, Value
from damageest.registry import Registry
from damageest.registry.contracts import DEFAULTS, contract_of
from damageest.registry.hookspecs import hookimpl
from damageest.result import Result
from damageest.stages.allowance import Allowance
from tests import damaged_box

LEAST = {"version": 1, "part": "box.stl", "scan": "scan.ply"}


class Counting(Allowance):
    """A stage that does what the test says."""

    use: str = "none"
    act: Any = Field(None, exclude=True)

    def run(self, damage: Any) -> Any:
        return self.act(damage)


def engine_with(act: Any, registry: Registry, tmp_path: Path, **more: Any) -> Engine:
    job: Job = load(damaged_box.write(tmp_path, points=60), registry)
    stage = Counting.model_construct(use="none", act=act)
    item = dataclasses.replace(job.implementations[Allowance], cls=Counting)
    job = dataclasses.replace(
        job, stages={**job.stages, Allowance: stage}, implementations={**job.implementations, Allowance: item}
    )
    return Engine(job, registry, **more)


def state(site: int = 0, key: str = "k") -> Candidate:
    job = JobState({"unit": "mm", "part": None, "tolerance": 0.1}, dict.fromkeys(("unit", "part", "tolerance"), key))
    return Candidate({"damage": damaged_box.box()}, {"damage": key}, job=job, number=site)


def test_contract_of_the_test_stage() -> None:
    assert contract_of(Counting) is Allowance


@pytest.mark.parametrize(
    ("error", "kind", "texts"),
    [
        (StageError("too thin", "a thicker one"), StageError, ["allowance: none (site 3): too thin", "try: a thicker"]),
        (InputError("no good"), InputError, ["no good"]),
        (ValueError("odd\nmore"), StageError, ["(site 3)", "ValueError: odd", "--debug"]),
        (KeyError(), StageError, ["(site 3)", "KeyError"]),
        (MemoryError(), StageError, ["(site 3)", "out of memory", "larger tolerance"]),
        (OSError(28, "No space left on device"), StageError, ["(site 3)", "No space left"]),
    ],
)
def test_errors_carry_their_place(
    error: Exception, kind: type[Exception], texts: list[str], registry: Registry, tmp_path: Path
) -> None:
    def act(damage: Any) -> Any:
        raise error

    engine = engine_with(act, registry, tmp_path)
    with pytest.raises(kind) as caught:
        engine.call(Allowance, state(3))
    assert isinstance(caught.value, DamageestError)
    assert all(text in str(caught.value) for text in texts)
    assert len(str(caught.value).splitlines()) <= 2
    assert not engine.records


@pytest.mark.parametrize("value", [7, "text", np.zeros(3), [1]])
def test_a_value_of_another_type_is_refused_and_not_kept(value: Any, registry: Registry, tmp_path: Path) -> None:
    engine = engine_with(lambda damage: value, registry, tmp_path, cache=Cache(tmp_path / "stages"))
    with pytest.raises(StageError, match=f"gave a {type(value).__name__} where its contract promises Solid"):
        engine.call(Allowance, state())
    assert not list((tmp_path / "stages").glob("*"))


def test_a_stage_runs_once_on_the_same(registry: Registry, tmp_path: Path) -> None:
    calls: list[Any] = []
    engine = engine_with(lambda damage: calls.append(damage), registry, tmp_path, cache=Cache(tmp_path / "stages"))
    for _ in range(2):
        engine.call(Allowance, state())
    assert len(calls) == 1
    engine.call(Allowance, state(key="another"))
    assert len(calls) == 2
    assert [record.cached for record in engine.records] == [False, True, False]
    later = engine_with(lambda damage: calls.append(damage), registry, tmp_path, cache=Cache(tmp_path / "stages"))
    later.call(Allowance, state())
    assert len(calls) == 2, "what an earlier run kept is found again"


def test_a_site_that_fails_does_not_stop_the_others(registry: Registry, tmp_path: Path) -> None:
    def act(damage: Any) -> Any:
        raise StageError("not this one")

    engine = engine_with(act, registry, tmp_path)
    done = engine_with(lambda damage: None, registry, tmp_path)
    work = state().job.with_value(JobState.candidates, (state(1), state(2, "l")), "c")
    work = work.with_value(JobState.failures, ())
    failed = follow((Allowance,), engine, work)
    assert not failed.candidates
    assert [error.site for error in failed.failures] == [1, 2]
    assert len(follow((Allowance,), done, work).candidates) == 2


def test_a_value_needs_a_key() -> None:
    with pytest.raises(ValueError, match="'damage' needs a key"):
        state().with_value(Candidate.damage, None, "")


def test_a_value_that_is_not_there_yet_is_named() -> None:
    with pytest.raises(KeyError, match="surface"):
        _ = state().surface


def test_states_declare_what_contracts_give_and_take() -> None:
    """Each name of a contract is a value of the states that it is called on."""
    for contract in DEFAULTS:
        states = (Candidate, FoundSite, JobState) if contract.per_site else (JobState,)
        for name in (contract.gives, *contract.takes()):
            assert any(isinstance(getattr(kind, name, None), Value) for kind in states), (contract.stage, name)


class Noisy:
    @hookimpl
    def damageest_after_stage(self, stage: str) -> None:
        if stage in ("segment", "export"):
            raise RuntimeError("no disk for my log")


@pytest.mark.slow
def test_an_observer_that_fails_does_not_stop_the_run(small_done: Path, small_result: Result) -> None:
    with pytest.warns(RuntimeWarning, match="no disk for my log"):
        watched = damageest.run(small_done, registry=Registry.discover([Noisy()]), output=True)
    assert watched.status == "ok"
    assert watched.damage_volume == small_result.damage_volume


@pytest.mark.variants(1)
@pytest.mark.parametrize(("setting", "are_taken"), [("sample=uniform", False), ("segment=cloud_distance", True)])
def test_points_on_all_of_the_skin_are_made_only_where_a_stage_takes_them(
    setting: str, are_taken: bool, small_done: Path, registry: Registry
) -> None:
    result = damageest.run(small_done, settings=[setting], output=True, registry=registry)
    assert ("sample" in {record.stage for record in result.stages}) == are_taken
    assert result.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.03)
    note = "sample: uniform did not run: no stage uses its points"
    assert (note in map(str, result.warnings)) != are_taken


def test_only_what_changed_runs_again(small_done: Path, small_result: Result, registry: Registry) -> None:
    """Another scan under the same name leaves what came from the part alone, and nothing that came from the scan."""
    path = small_done
    assert not [r for r in small_result.stages if not r.cached and r.stage not in ("export", "report")]
    x, y, z = damaged_box.scan(2000).T
    write_points(path.parent / "scan.ply", {"x": x, "y": y, "z": z})
    again = damageest.run(path, output=True, registry=registry)
    # `path: none` takes nothing, so nothing has changed for it
    assert {record.stage for record in again.stages if record.cached} == {"part", "path"}
    assert again.scan.points.shape == (2000, 3)


@pytest.mark.slow
def test_other_options_of_a_stage_run_it_again_and_nothing_before(small_done: Path, registry: Registry) -> None:
    nearby = damageest.run(small_done, output=True, registry=registry, settings=["cluster.neighbours=11"])
    cached = {record.stage for record in nearby.stages if record.cached}
    assert {"part", "scan", "align", "segment"} <= cached
    assert "cluster" not in cached
