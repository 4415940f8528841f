"""What result.json says of a result."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from damageest.artefacts import Floats, Vector
from damageest.findings import NoiseLevel, Sensor, VariogramPoint
from damageest.output.adapt_json import AdaptReport, report_adapt
from damageest.output.base import JsonModel
from damageest.output.deviation_json import DeviationReport, report_deviation
from damageest.output.fit_json import FitReport, report_fit
from damageest.output.free_json import DatumReport, FreeMotionReport, LeftMotionReport
from damageest.output.provenance import ProvenanceReport
from damageest.output.reason_json import ReasonReport
from damageest.output.section_json import SectionReport, report_section
from damageest.output.site_json import MaterialReport, SiteReport, index_files, report_site, sum_material
from damageest.output.skin_json import CoverageReport, SurplusReport, report_surplus
from damageest.output.uncertainty_json import BudgetReport, ReportedInterval
from damageest.result import Result, StageRecord, StepRecord
from damageest.stages.export import ExportedFiles

_NOTHING = ExportedFiles()
DIALECT = "https://json-schema.org/draft/2020-12/schema"


class PartReport(JsonModel):
    path: str = Field(description="relative to this file; empty for a part given as arrays")
    sha256: str
    volume: float
    watertight: bool
    tessellation_error: float = Field(description="bound on the distance between CAD surface and triangles")
    notes: list[str] = Field(description="repairs and conversions at reading")


class NoiseLevelReport(JsonModel, of=NoiseLevel): ...


class VariogramReport(JsonModel, of=VariogramPoint): ...


class SensorReport(JsonModel, of=Sensor):
    """The errors of the sensor, measured on intact skin."""


class ScanReport(JsonModel):
    paths: list[str]
    points: int
    total: int = Field(description="points in the files, of which `points` are used: all near damage, others evenly")
    noise: float = Field(description="measured standard deviation of the points off the local surface")
    spacing: float = Field(description="measured distance that a reconstructed surface has to bridge")
    notes: list[str]


class RescaledReport(JsonModel):
    factor: float = Field(description="divisor of the scan's lengths, for temperature and scale")
    centre: Vector = Field(description="the place in the scanner's frame about which they were, which stays")


class AlignmentReport(JsonModel):
    transform: list[list[float]] = Field(description="T_part_scan, 4x4: from the scanner's frame to the part's")
    quaternion: tuple[float, float, float, float] = Field(
        description="rotation as a quaternion: w, x, y, z; w is not negative"
    )
    translation: Vector = Field(description="shift, after the rotation")
    rms: float = Field(description="root mean square distance of the inliers to the part")
    inliers: float = Field(description="share of the scan's points")
    alternatives: list[list[list[float]]] = Field(
        description="other poses that fit as well, for example on a symmetric part"
    )
    notes: list[str]
    doubts: list[ReasonReport] = Field(description="reasons against the pose, and so against every site")
    free: list[FreeMotionReport] = Field(description="motions that no unworn skin fixes")
    datums: list[DatumReport] = Field(description="datums of a datum system, in the order of precedence; else empty")
    left: list[LeftMotionReport] = Field(description="motions that the datum system leaves free, fixed by other skin")
    held: bool = Field(description="whether unworn skin fixes all other motions")
    rescaled: RescaledReport | None = Field(
        None,
        description="only where the lengths of the scan were corrected: a raw point x is at "
        "transform (centre + (x - centre) / factor) in the part",
    )


class ExportReport(JsonModel):
    files: list[str] = Field(
        description="all that were written, in the part's frame, which is that of the adapted part where adapt is not "
        "null; those below scan_frame/ are in the scan's frame, those below nominal_frame/ on the part as designed"
    )
    notes: list[str] = Field(description="differences from the job, with the reason")


class TruthReport(JsonModel):
    """Only after a virtual scan: how far the result is from the known truth."""

    volume: float
    iou: float = Field(description="intersection over union of found and true damage")
    transform: list[list[float]] = Field(description="the true T_part_scan")


class StageReport(JsonModel, of=StageRecord): ...


class StepReport(JsonModel, of=StepRecord): ...


class Report(JsonModel):
    """The content of result.json. Lengths, areas and volumes in ``units``; coordinates in the part's frame."""

    version: Literal[1] = Field(1, alias="schema", description="version of this format")
    status: Literal["ok", "incomplete"] = Field(description="incomplete: some sites have no damage volume or deposit")
    name: str
    units: str
    tolerance: float
    part: PartReport
    scan: ScanReport
    sensor: SensorReport | None = Field(description="null where nothing was measured")
    alignment: AlignmentReport
    deviation: DeviationReport
    coverage: CoverageReport | None
    adapt: AdaptReport | None = Field(description="null where the part is as designed")
    fit: FitReport | None = Field(description="null where too few points lie near the skin")
    sites: list[SiteReport]
    surplus: list[SurplusReport] = Field(description="bodies outside the nominal surface, surroundings last")
    sections: list[SectionReport] = Field(description="sections of the job")
    export: ExportReport
    damage_volume: float
    volume_95: ReportedInterval | None = Field(
        description="95 % interval of `damage_volume`, its high end null where nothing limits it; null: there is none"
    )
    budget: BudgetReport | None = Field(
        description="budget of uncertainty of `damage_volume` (JCGM 100); null where there is no interval or no site"
    )
    not_in_budget: list[str] = Field(description="sources that the job does not give: not included in any interval")
    certificate: str = Field(description="scanner and standard of its certificate; empty where the job has none")
    undamaged_volume: float
    material: MaterialReport = Field(description="material of the whole repair")
    truth: TruthReport | None
    stages: list[StageReport]
    steps: list[StepReport] = Field(description="steps between the stages, up to the report")
    failures: list[str] = Field(description="sites without a damage volume or a deposit, and why")
    warnings: list[ReasonReport] = Field(description="notes on the whole run, most important first")
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

    part, scan, pose = result.part, result.scan, result.pose
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
        alignment=AlignmentReport.read(
            pose,
            transform=pose.T_part_scan,
            quaternion=_to_quaternion(pose.T_part_scan),
            translation=pose.T_part_scan[:3, 3],
            alternatives=[] if pose.alternatives is None else pose.alternatives,
            held=pose.is_held,
            rescaled=None
            if result.scan_factor == 1 or result.scan_centre is None
            else RescaledReport(factor=result.scan_factor, centre=tuple(result.scan_centre.tolist())),
        ),
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


def _to_quaternion(T: Floats) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True).tolist()
    return w, x, y, z


def _report_truth(result: Result) -> TruthReport | None:
    truth = result.scan.truth
    if truth is None or result.truth is None:
        return None
    volume, iou = result.truth.tolist()
    return TruthReport(volume=volume, iou=iou, transform=truth.T_part_scan)
