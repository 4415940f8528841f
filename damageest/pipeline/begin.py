"""The state before any stage."""

from __future__ import annotations

from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine
from damageest.pipeline.reach import find_reach
from damageest.pipeline.state import JobState
from damageest.registry.contracts import Contract
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.stages.enclose import Enclose, EncloseAll
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment

OPTIONS: dict[str, Contract] = {
    "reader": ReadScan,
    "aligner": Align,
    "adapter": Adapt,
    "segmenter": Segment,
    "encloser": Enclose,
    "encloser_at_once": EncloseAll,
}
"""The stages whose options steps read, by the names of these values."""


def start(engine: Engine) -> JobState:
    """The state before any stage: what the job and the registry say."""
    job, registry = engine.job, engine.registry
    state = JobState().with_value(JobState.name, job.name).with_value(JobState.unit, job.units)
    state = state.with_named("tolerance", job.tolerance, digest(job.tolerance))
    state = state.with_value(JobState.asked_tolerance, job.tolerance)
    state = state.with_value(JobState.choice, job.sites, digest(job.sites.model_dump()))
    state = state.with_value(JobState.accept, job.accept)
    for name, told in (("scanner", job.scanner), ("temperature", job.temperature)):
        state = state.with_named(name, told, digest(str(told and told.model_dump())))
    asked = digest([one.model_dump() for one in job.sections])
    state = state.with_value(JobState.asked_sections, job.sections, asked)
    for name, contract in OPTIONS.items():  # the content of files that they name is in the key of what they give
        stage = job.stages.get(contract)
        state = state.with_named(name, stage, digest(str(stage and stage.model_dump())))
    state = state.with_value(JobState.rules, registry.rules, digest([rule.code for rule in registry.rules]))
    state = state.with_value(JobState.terms, registry.terms, digest([term.name for term in registry.terms]))
    state = state.with_value(JobState.writers, registry.writers, digest(sorted(registry.writers)))
    state = state.with_value(JobState.path_writers, registry.path_writers, digest(sorted(registry.path_writers)))
    state = state.with_value(JobState.conversions, registry.conversions, digest(sorted(registry.conversions)))
    state = state.with_value(JobState.reach, find_reach(job, registry))
    for name in ("samples", "nearby"):  # until an implementation takes them
        state = state.with_named(name, None, digest(None))
    for name in ("candidates", "found", "failures", "warnings"):
        state = state.with_named(name, (), digest(()))
    return state.with_value(JobState.wanted, None)
