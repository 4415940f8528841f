"""What result.json says of a result."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from damageest.artefacts import Part, Scan
from damageest.findings import NoiseLevel, Sensor, VariogramPoint
from damageest.output.adapt_json import AdaptReport, report_adapt
from damageest.output.base import JsonModel
from damageest.output.pose_json import AlignmentReport, report_alignment, report_fit
from damageest.output.provenance import ProvenanceReport
from damageest.output.section_json import report_section
from damageest.output.site_json import MaterialReport, index_files, report_site, sum_material
from damageest.output.skin_json import DeviationReport, report_deviation, report_surplus
from damageest.output.uncertainty_json import ReportedInterval
from damageest.result import Result, StageRecord, StepRecord
from damageest.stages.export import ExportedFiles

_NOTHING = ExportedFiles()
DIALECT = "https://json-schema.org/draft/2020-12/schema"


class PartReport(JsonModel, of=Part, fields="path sha256 volume watertight tessellation_error notes"):
    path: str = Field(description="relative to this file; empty for a part given as arrays")
    volume: float
    watertight: bool


class NoiseLevelReport(JsonModel, of=NoiseLevel): ...


class VariogramReport(JsonModel, of=VariogramPoint): ...


class SensorReport(JsonModel, of=Sensor):
    """The errors of the sensor, measured on intact skin."""


class ScanReport(JsonModel, of=Scan, fields="paths points total noise spacing notes"):
    points: int
    total: int = Field(description="points in the files, of which `points` are used: all near damage, others evenly")


class ExportReport(JsonModel, of=ExportedFiles, fields="files notes"): ...


class TruthReport(JsonModel):
    """Only after a virtual scan: how far the result is from the known truth."""

    volume: float
    iou: float = Field(description="intersection over union of found and true damage")
    transform: list[list[float]] = Field(description="the true T_part_scan")


class StageReport(JsonModel, of=StageRecord): ...


class StepReport(JsonModel, of=StepRecord): ...


class Report(
    JsonModel,
    of=Result,
    fields="version status name units tolerance part scan sensor alignment deviation coverage adapt fit sites surplus "
    "sections export damage_volume volume_95 budget not_in_budget certificate undamaged_volume material truth stages "
    "steps failures warnings versions provenance",
):
    """The content of result.json. Lengths, areas and volumes in ``units``; coordinates in the part's frame."""

    version: Literal[1] = Field(1, alias="schema", description="version of this format")
    alignment: AlignmentReport
    deviation: DeviationReport
    adapt: AdaptReport | None = Field(description="null where the part is as designed")
    export: ExportReport
    volume_95: ReportedInterval | None
    material: MaterialReport = Field(description="material of the whole repair")
    truth: TruthReport | None
    versions: dict[str, str]
    provenance: ProvenanceReport | None = Field(None, description="null in a result that is not in files")


def result_schema() -> dict[str, Any]:
    """The JSON Schema of result.json."""
    from importlib.metadata import version

    comment = f"written by damageest {version('damageest')}"
    return {
        "$schema": DIALECT,
        "$comment": comment,
        **Report.model_json_schema(mode="serialization"),
        "title": "damageest result",
    }


def build_report(result: Result, written: ExportedFiles = _NOTHING, relative: Any = str) -> dict[str, Any]:
    """The content of result.json as plain values. ``relative`` turns an absolute input path into the one to write."""
    import platform
    from importlib.metadata import version

    part, scan = result.part, result.scan
    files = index_files(written.files)
    sites = [report_site(site, written, files) for site in result.sites]
    filled = Report.read(
        result,
        version=1,
        part=PartReport.read(part, path=relative(part.path) if part.path else "", watertight=True),
        scan=ScanReport.read(
            scan,
            paths=[relative(path) for path in scan.paths],
            points=len(scan.points),
            total=scan.total or len(scan.points),
        ),
        alignment=report_alignment(result),
        deviation=report_deviation(result.deviation),
        adapt=report_adapt(result.adapted, result.sites),
        fit=report_fit(result.fit),
        sites=sites,
        surplus=[report_surplus(item, result, written) for item in result.surplus],
        sections=[report_section(section, written) for section in result.sections],
        export=ExportReport.read(written),
        material=sum_material([site.deposit for site in sites if site.deposit]),
        truth=_report_truth(result),
        versions={"damageest": version("damageest"), "python": platform.python_version()},
        provenance=None,
    )
    content = filled.model_dump(mode="json", by_alias=True)
    if content["alignment"]["rescaled"] is None:
        del content["alignment"]["rescaled"]
    return content


def to_dict(result: Result, what: str, site: int | None) -> dict[str, Any]:
    """The content of result.json without files, as a conversion of a result."""
    return build_report(result)


def _report_truth(result: Result) -> TruthReport | None:
    truth = result.scan.truth
    if truth is None or result.truth is None:
        return None
    volume, iou = result.truth.tolist()
    return TruthReport(volume=volume, iou=iou, transform=truth.T_part_scan)
