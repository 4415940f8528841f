"""The step that puts the adapted part in the place of the part as designed."""

from __future__ import annotations

from dataclasses import replace

from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, Step
from damageest.pipeline.state import JobState, Work
from damageest.registry.contracts import Contract
from damageest.rules.notes import make_notes
from damageest.stages.adapt import Adapt
from damageest.stages.sample import Sample


def adapt_part(adapt: Contract) -> Step:
    """A step that calls the contract, unless the job takes the part as designed, and goes on with what it gives."""

    def run(engine: Engine, work: Work) -> Work:
        stage = engine.job.stages[adapt]
        if adapt not in engine.job.given and isinstance(stage, Adapt) and not stage.deforms:
            return replace(work, job=work.job.with_value(JobState.adapted, None, digest("as designed")))
        work = replace(work, job=engine.call(adapt, work.job))
        return take_adapted(engine, work)

    return run


def take_adapted(engine: Engine, work: Work) -> Work:
    """The work with the adapted part as its part, the scan and its pose moved onto it, and samples on its skin."""
    state = work.job
    adapted = state.adapted
    if adapted is None:
        return work
    pose = replace(state.pose, T_part_scan=adapted.motion @ state.pose.T_part_scan)
    state = state.derive(JobState.aligned, state.aligned.move(adapted.motion), JobState.aligned, JobState.adapted)
    state = state.derive(JobState.pose, pose, JobState.pose, JobState.adapted)
    state = state.derive(JobState.part, adapted.part, JobState.part, JobState.adapted)
    state = engine.make_silent().call(Sample, state)
    return replace(work, job=state, warnings=(*work.warnings, *make_notes("adapt", adapted.notes)))
