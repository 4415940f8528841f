"""Points on the part's skin: on all of it for implementations that take them, and near the damage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import ADDED, INTACT, Samples, Sites
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin_near import NearCubes, find_cubes_near, sample_near
from damageest.pipeline.engine import Branch, Engine, follow
from damageest.pipeline.state import JobState, Reasons
from damageest.pipeline.steps import Step, step
from damageest.registry.contracts import DEFAULTS, Contract
from damageest.rules.notes import make_notes
from damageest.stages.enclose import EncloseAll
from damageest.stages.sample import Sample

EDGE_SPACINGS, MOST_EDGE = 16.0, 40.0
"""Edge of the cubes in which skin is near damage, in spacings of the scan and, at most, in tolerances: in cubes with
fewer points it is a matter of chance whether the scan shows their skin."""
FINE, FINE_SPACINGS = 6.0, 3.0
"""Distance from damaged points up to which the points on the skin are a tolerance apart, in tolerances, and in spacings
of the scan: there lies the rim. It reaches at most twice as far."""


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


def note_unused(engine: Engine, samples: Samples | None) -> Reasons:
    """Names stage `sample` where the job changes it and nothing took its points."""
    stage, usual = engine.job.stages[Sample], engine.registry.get(Sample.stage, DEFAULTS[Sample])
    if samples is not None or (stage.use == usual.name and stage == usual.cls.model_validate({})):
        return ()
    return make_notes(Sample.stage, (f"sample: {stage.use} did not run: no stage uses its points",))


@step(gives="nearby")
def sample_near_damage(field: ScanField, sites: Sites, encloser_at_once: EncloseAll | None) -> Samples:
    """Points on the part's skin near the damage: a tolerance apart about the rim and where the scan shows no skin, two
    elsewhere."""
    part, aligned, tolerance = field.part, field.aligned, field.tolerance
    on_skin = (field.label == INTACT) | (field.label == ADDED)
    damaged = np.flatnonzero(sites.label > 0)
    places, intact = aligned.points[damaged], aligned.points[on_skin]
    feet = field.find_feet(damaged)
    reach = encloser_at_once.nearby_reach if encloser_at_once else MOST_EDGE
    edge = max(reach * tolerance, min(EDGE_SPACINGS * aligned.spacing, MOST_EDGE * tolerance))
    near, unseen = find_cubes_near(part, places, feet, intact, edge)
    # where the scan ends beside damage, the surface ends somewhere beyond its points: wide samples would let it go on
    fine = NearCubes.around(np.concatenate([places, unseen]), max(FINE * tolerance, FINE_SPACINGS * aligned.spacing))
    return sample_near(part, near, fine, tolerance)
