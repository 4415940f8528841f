"""Faults of a job that show only where its stages are seen together, and in what they need: told before any work."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.util import find_spec

from damageest.errors import clean_message, describe_missing_library
from damageest.job.folders import describe_part_among
from damageest.registry.contracts import SURFACE_ONLY, Contract
from damageest.registry.registry import Registry
from damageest.stages import Stage
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan

Place = tuple[str | int, ...]


def find_late_faults(
    stages: Mapping[Contract, Stage | None], method: str, registry: Registry
) -> list[tuple[Place, str]]:
    """What would fail after hours of work: places in the job, with the fault. ``stages``: checked one by one, None for
    one that is at fault itself."""
    found: list[tuple[Place, str]] = []
    if among := describe_part_among(stages.get(ReadPart), stages.get(ReadScan)):
        found.append(((ReadScan.stage, "path"), among))
    by_name = {contract.stage: stage for contract, stage in stages.items() if stage is not None}
    for contract, stage in stages.items():
        if stage is None:
            continue
        is_certain = method == "surface" or contract not in SURFACE_ONLY  # else it is tried where another method fails
        for module in stage.modules if is_certain else ():
            if find_spec(module) is None and (missing := describe_missing_library(ModuleNotFoundError(name=module))):
                found.append(
                    ((contract.stage, "use"), f"'{stage.use}' cannot run: {missing.message}; {missing.remedy}")
                )
        try:
            found += [((contract.stage, *place), text) for place, text in stage.find_faults(by_name, registry)]
        except Exception as error:  # of a plugin's own check
            text = f"{type(error).__name__}: {clean_message(error, 400)}"
            who = registry.get(contract.stage, stage.use).provider
            found.append(((contract.stage,), f"{who} failed when it checked the options of '{stage.use}': {text}"))
    return found
