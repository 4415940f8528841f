"""A job as values: the fields that are not stages, and the checked job."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, FiniteFloat, PositiveInt

from damageest.errors import Fault
from damageest.job.scanner import ScannerInfo, Temperature
from damageest.job.sections import SectionChoice
from damageest.options import Options, require_number
from damageest.registry.contracts import DEFAULTS, SURFACE_ONLY, Contract
from damageest.registry.registry import Implementation
from damageest.stages import Stage
from damageest.stages.enclose import EncloseAll

Unit = Literal["um", "mm", "cm", "m", "in", "ft"]


Accept = Literal["proven", "likely", "all"] | tuple[PositiveInt, ...]


Corner = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class Box(Options):
    """A box along the axes of the part's frame."""

    min: Corner = Field(description="lowest corner, in the job's unit")
    max: Corner = Field(description="highest corner, in the job's unit")


class SiteChoice(Options):
    """Decisions on sites, by their numbers in the table of a run without these decisions."""

    drop: tuple[PositiveInt, ...] = Field((), description="numbers of sites to drop")
    merge: tuple[tuple[PositiveInt, ...], ...] = Field(
        (), description="lists of site numbers to merge; the merged site gets the lowest number"
    )
    keep: Box | None = Field(None, description="keeps only sites whose centre of bounds lies in this box; default: all")


class InspectChoice(Options):
    """Criteria of `damageest inspect` for scans after a repair step."""

    defect: float | None = Field(
        None, gt=0, description="width of the least defect that matters, in the job's unit; default: 15 tolerances"
    )
    elsewhere: Literal["decides", "listed"] = Field(
        "decides", description="findings outside all sites make the part not met (decides), or are only listed"
    )
    fixtures: tuple[Box, ...] = Field(
        (), description="boxes around fixtures; default: a body that touches a site counts as part of it"
    )


GROUPS = ("sites", "scanner", "temperature", "inspect")
"""Fields of the job beside its stages that have fields of their own."""


class Header(Options):
    """The fields of a job that are not stages."""

    version: Annotated[Literal[1], BeforeValidator(require_number)] = Field(description="version of the job format")
    name: str = Field("", pattern=r"^[^/\\\x00]*$", description="name of the job; default: the file's stem")
    units: Unit = Field("mm", description="unit of every length in the job, and of files without a unit")
    tolerance: Annotated[float, Field(gt=0, allow_inf_nan=False)] | Literal["auto"] = Field(
        "auto",
        description="lambda, the threshold of accuracy, in the job's unit; auto: four times the scan's noise, "
        "more where its depth has steps or intact surface deviates by more",
    )
    method: str = Field(
        "auto",
        description="the route; surface: site by site; implicit: all sites at once; auto: implicit, then surface for "
        "sites that it fails on or that the scan contradicts; both: as auto, and a site whose volume by the other "
        "method is outside its interval is doubtful; plugins may add others",
    )
    sites: SiteChoice = Field(SiteChoice(), description="sites to drop, to merge and to keep")
    sections: tuple[SectionChoice, ...] = Field(
        (), description="sections of part and scan, for example of blades and shafts, and depth of wear along lines"
    )
    accept: Accept = Field(
        "likely",
        description="which sites are damage: proven, likely (and proven) or all; or numbers of doubtful sites to take "
        "beside those that are likely",
    )
    scanner: ScannerInfo | None = Field(
        None, description="the scanner and its certificate, for the budget of uncertainty; default: unknown"
    )
    temperature: Temperature | None = Field(
        None,
        description="temperature of the part at the scan: the scan is scaled to 20 °C; default: unknown, no correction",
    )
    inspect: InspectChoice | None = Field(
        None,
        description="criteria of `damageest inspect` for scans after the repair; default: the tolerance alone",
    )
    output: Path | None = Field(None, description="output folder; default: out/<name>, beside the job file")


def _make_fault(message: str, *path: str | int) -> Fault:
    return Fault(message, ".".join(map(str, path)))


@dataclass(frozen=True)
class Job:
    """A checked job. ``stages`` holds one implementation with its options for every contract, ``given`` the artefacts
    that a Python caller handed in instead of files. ``tolerance`` None: from the scan's noise. ``notes``: options by
    former names. ``make_fault`` makes the fault of an option, with its line and column."""

    name: str
    units: str
    tolerance: float | None
    method: str
    stages: Mapping[Contract, Stage]
    implementations: Mapping[Contract, Implementation]
    output: Path
    source: str
    sites: SiteChoice = field(default_factory=SiteChoice)
    accept: Accept = "likely"
    scanner: ScannerInfo | None = None
    temperature: Temperature | None = None
    sections: tuple[SectionChoice, ...] = ()
    inspect: InspectChoice | None = None
    given: Mapping[Contract, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    make_fault: Callable[..., Fault] = field(default=_make_fault, compare=False)

    def to_values(self, beside: Path) -> dict[str, Any]:
        """The job as plain values with every default, its paths relative to the folder ``beside``."""
        head = {"version": 1, "name": self.name, "units": self.units, "tolerance": self.tolerance or "auto"}
        head |= {"method": self.method, "sites": to_plain(self.sites.model_dump(), beside)}
        head |= {"sections": [to_plain(one.model_dump(exclude_defaults=True), beside) for one in self.sections]}
        head |= {"accept": to_plain(self.accept, beside)}
        for name, told in (
            ("scanner", self.scanner),
            ("temperature", self.temperature),
            ("inspect", self.inspect),
        ):
            if told is not None:
                head[name] = to_plain(told.model_dump(), beside)
        whole_job = EncloseAll in self.stages
        used = [c for c in DEFAULTS if c in self.stages and not (whole_job and c in SURFACE_ONLY)]
        body = {c.stage: to_plain(self.stages[c].model_dump(), beside) for c in used}
        return head | body


def to_plain(value: Any, beside: Path) -> Any:
    """Options as YAML and JSON values; absolute paths become relative to ``beside``."""
    if isinstance(value, Path):
        return Path(os.path.relpath(value, beside)).as_posix() if value.is_absolute() else value.as_posix()
    if isinstance(value, Mapping):
        return {key: to_plain(item, beside) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [to_plain(item, beside) for item in value]
    return value


def find_paths(value: Any, place: tuple[str | int, ...] = ()) -> list[tuple[tuple[str | int, ...], Path]]:
    """The paths among the options of a stage, each with its place."""
    if isinstance(value, Path):
        return [(place, value)]
    items: Any = value.items() if isinstance(value, Mapping) else ()
    items = enumerate(value) if isinstance(value, (list, tuple)) else items
    return [found for step, item in items for found in find_paths(item, (*place, step))]
