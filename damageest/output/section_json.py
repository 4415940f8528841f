"""What result.json says of sections."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from damageest.artefacts import Section, SectionValue
from damageest.output.base import JsonModel
from damageest.stages.export import ExportedFiles


class SectionValueReport(JsonModel, of=SectionValue, fields="name nominal measured difference error unit note"):
    """One quantity of a section."""

    unit: Literal["length", "degrees"]


class SectionReport(
    JsonModel,
    of=Section,
    fields="number name group kind origin along out across seen slab points values notes files",
):
    """A section that the job asks for, of the part as designed and of the scan in the pose of the run."""

    kind: Literal["blade", "round", "contour", "line", "none"]
    files: list[str] = Field(description="files: its stations as a table, and its drawing")


def report_section(section: Section, written: ExportedFiles) -> SectionReport:
    """The report of one section."""
    stem = f"sections/section-{section.number}."
    return SectionReport.read(section, files=[name for name in written.files if name.startswith(stem)])
