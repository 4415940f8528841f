"""Checks what a job says of the part's skin and CAD faces as soon as the part is read, before anything else."""

from __future__ import annotations

from damageest.artefacts import Part
from damageest.errors import Fault, JobError, StageError
from damageest.geometry.near_faces import name_nearest_skin
from damageest.job.model import Job
from damageest.pipeline.begin import start
from damageest.pipeline.engine import Engine, follow
from damageest.pipeline.steps import step
from damageest.registry.registry import Registry
from damageest.stages.part import ReadPart


@step()
def check_selections(engine: Engine, part: Part) -> None:
    """Raises JobError where a selector of a stage names a CAD face that the part does not have, or selects no skin of
    the part, and where a region to keep free is out of reach of any deposit."""
    if any(stage.find_selectors() for stage in engine.job.stages.values()):
        faults = find_wrong_selections(engine.job, part)
        if faults:
            raise JobError(faults, engine.job.source)


def check_with_part(job: Job, registry: Registry) -> None:
    """Reads the part and checks the job against it, where the job selects skin or CAD faces; else does nothing.

    Raises JobError, or InputError where the part cannot be read.
    """
    if any(stage.find_selectors() for stage in job.stages.values()):
        engine = Engine(job, registry)
        follow((ReadPart, check_selections), engine, start(engine))


def find_wrong_selections(job: Job, part: Part) -> list[Fault]:
    """What is wrong with the selectors of all stages of a job."""
    faults = []
    for contract, stage in job.stages.items():
        for place, selector in stage.find_selectors():
            if not selector.chooses_skin():
                if text := stage.find_idle_region(selector, part):
                    faults.append(job.make_fault(text, contract.stage, *place))
                continue
            try:
                found = selector.finds_skin(part)
            except StageError as error:
                faults.append(job.make_fault(f"{error.args[0]}; {error.remedy}", contract.stage, *place))
                continue
            if not found:
                text = (
                    f"no skin of the part is selected by {' and '.join(selector.conditions())}: "
                    f"{name_nearest_skin(selector, part)}; "
                    "correct the conditions (lengths in the job's unit, places in part coordinates), or remove it"
                )
                faults.append(job.make_fault(text, contract.stage, *place))
    return sorted(faults, key=lambda fault: (fault.line, fault.column))
