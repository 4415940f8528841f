"""What the machine of a job's paths reaches, for those who plan the paths."""

from __future__ import annotations

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest.job.model import Job
from damageest.registry.registry import Registry
from damageest.stages.export import Export
from damageest.stages.path import Path


def find_reach(job: Job, registry: Registry) -> Floats | None:
    """The tool axes that the machine of the job's paths reaches, see the stage `path`; None for all, and where it names
    none."""
    planner, export = job.stages.get(Path), job.stages.get(Export)
    if not (isinstance(planner, Path) and planner.plans_paths and isinstance(export, Export)):
        return None
    try:
        return export.find_reach(registry.path_writers)
    except StageError:  # the check of the job has said so, or the export will
        return None
