"""What result.json says of sections."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from damageest.artefacts import Section, Vector
from damageest.output.base import JsonModel
from damageest.stages.export import ExportedFiles


class SectionValueReport(JsonModel):
    """One quantity of a section."""

    name: str
    nominal: float | None = Field(description="value as designed")
    measured: float | None = Field(description="value as scanned; null where the scan does not show it")
    difference: float | None = Field(description="measured less nominal")
    error: float = Field(description="standard uncertainty of `measured`")
    unit: Literal["length", "degrees"] = Field(description="length: the job's unit")
    note: str = Field(description="why there is no value, or its range of validity; else empty")


class SectionReport(JsonModel):
    """A section that the job asks for, of the part as designed and of the scan in the pose of the run."""

    number: int
    name: str
    group: int = Field(description="number, from 1, of the item of the job's `sections`")
    kind: Literal["blade", "round", "contour", "line", "none"] = Field(description="none: nothing of the part is here")
    origin: Vector = Field(description="zero of the plane's coordinates")
    along: Vector = Field(description="first axis of the plane, unit vector; of a line its direction")
    out: Vector = Field(description="second axis of the plane, unit vector")
    across: Vector = Field(description="normal of the plane, unit vector")
    seen: float = Field(description="share of the outlines that the scan shows")
    slab: float = Field(description="scan points within this distance of the plane were used")
    points: int
    values: list[SectionValueReport]
    notes: list[str]
    files: list[str] = Field(description="files: its stations as a table, and its drawing")


def report_section(section: Section, written: ExportedFiles) -> SectionReport:
    """The report of one section."""
    stem = f"sections/section-{section.number}."
    return SectionReport.read(section, files=[name for name in written.files if name.startswith(stem)])
