"""A job's state in the middle of its route, and the rest of the route from there, for several decisions of the job."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from damageest.artefacts import Part, Scan
from damageest.isolation import keep_one_thread
from damageest.job import load
from damageest.pipeline.begin import start
from damageest.pipeline.engine import Branch, Engine, Step, follow
from damageest.pipeline.routes import route_of
from damageest.pipeline.state import JobState
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan

LATE = ("choice", "accept", "scanner", "temperature", "asked_sections", "encloser")
"""What the job says of the rest of the route."""


@dataclass(frozen=True)
class Halfway:
    """The ``state`` of a ``job`` before the item ``place`` of its route. ``given``: its part and its scan."""

    job: dict[str, Any]
    given: dict[Any, Any]
    place: int
    state: JobState
    engine: Engine

    @keep_one_thread()
    def finish(self, **decisions: Any) -> Result:
        """The result where the job also says ``decisions``, as `sites` and `accept`, that nothing before reads."""
        registry, before = self.engine.registry, self.engine
        job = load({**self.job, **decisions}, registry, (), self.given)
        engine = Engine(job, registry, memo=dict(before.memo), records=list(before.records), steps=list(before.steps))
        state, told = self.state, start(engine)
        for name in LATE:
            state = state.with_named(name, told.get(name), told.key(name))
        return follow(route_of(job.method)[self.place :], engine, state).result


@keep_one_thread()
def run_until(step: str, part: Part, scan: Scan, registry: Registry, **job: Any) -> Halfway:
    """Runs a job as far as the step of that name, which is not in a branch of the route."""
    job = {"version": 1, "report": "none", **job}
    given: dict[Any, Any] = {ReadPart: part, ReadScan: scan}
    engine = Engine(load(job, registry, (), given), registry)
    route = route_of(engine.job.method)
    place = next(k for k, one in enumerate(route) if isinstance(one, (Step, Branch)) and one.name == step)
    return Halfway(job, given, place, follow(route[:place], engine, start(engine)), engine)
