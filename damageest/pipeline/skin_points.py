"""Points on the part's skin: on all of it for implementations that take them, and near the damage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from damageest.artefacts import ADDED, INTACT, Deviation, Part, Samples, Scan, Sites
from damageest.geometry.skin_near import find_cubes_near, sample_near
from damageest.pipeline.engine import Branch, Engine, follow
from damageest.pipeline.state import JobState
from damageest.pipeline.steps import Step, step
from damageest.registry.contracts import Contract


def where_taken(item: Contract | Step[..., Any], by: Sequence[Contract]) -> Branch:
    """Follows ``item``, which gives one value, only where the job's implementation of a contract in ``by`` takes it:
    what nobody takes is not computed. Where it was given before, it stays."""
    name = item.gives[0] if isinstance(item, Step) else item.gives

    def run(engine: Engine, state: JobState) -> JobState:
        chosen = [engine.job.implementations[one] for one in by if one in engine.job.stages]
        if state.get(name) is not None or not any(name in one.cls.needs() for one in chosen):
            return state
        return follow((item,), engine, state)

    return Branch("where_taken", (name,), ((item,),), run)


@step(gives="nearby")
def sample_near_damage(part: Part, aligned: Scan, deviation: Deviation, sites: Sites, tolerance: float) -> Samples:
    """Points on the part's skin near the damaged points of the sites, a tolerance apart."""
    on_skin = (deviation.label == INTACT) | (deviation.label == ADDED)
    places, intact = aligned.points[sites.label > 0], aligned.points[on_skin]
    return sample_near(part, find_cubes_near(part, places, intact, tolerance), tolerance)
