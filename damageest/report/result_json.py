"""What result.json says of a result."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from damageest.artefacts import Deposit, Floats, Vector
from damageest.report.free_json import FreeMotionReport, report_free_motion
from damageest.result import Coverage, Result, Site, Surplus
from damageest.stages.export import ExportedFiles

_NOTHING = ExportedFiles()
DIALECT = "https://json-schema.org/draft/2020-12/schema"


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", populate_by_name=True)


class PartReport(_Model):
    path: str = Field(description="relative to this file; empty for a part given as arrays")
    sha256: str
    volume: float
    watertight: bool
    tessellation_error: float = Field(description="bound on the distance between CAD surface and triangles")
    notes: list[str] = Field(description="what was repaired or converted when the part was read")


class ScanReport(_Model):
    paths: list[str]
    points: int
    noise: float = Field(description="measured standard deviation of the points off the local surface")
    spacing: float = Field(description="measured distance that a reconstructed surface has to bridge")
    notes: list[str]


class AlignmentReport(_Model):
    transform: list[list[float]] = Field(description="T_part_scan, 4x4: from the scanner's frame to the part's")
    quaternion: tuple[float, float, float, float] = Field(description="its rotation: w, x, y, z; w is not negative")
    translation: Vector = Field(description="its shift, after the rotation")
    rms: float = Field(description="of the inliers' distance to the part")
    inliers: float = Field(description="share of the scan's points")
    alternatives: list[list[list[float]]] = Field(description="other poses that fit as well, as on a symmetric part")
    notes: list[str]
    doubts: list[str] = Field(description="those of the notes that make every site doubtful")
    free: list[FreeMotionReport] = Field(
        description="motions after which the scan fits as well, since no unworn skin holds it"
    )
    held: bool = Field(description="whether unworn skin holds the pose, but for these motions")


class EvidenceReport(_Model):
    ids_residual: float = Field(description="95th percentile of the IDS points' distance to the damage volume")
    intact_points_inside: int = Field(description="intact scan points on the skin that it removes")
    skin_contradicted: float = Field(description="share of the removed skin that intact scan points lie on")
    skin_unseen: float = Field(description="share of the skin beside the damage that the scan does not show")
    ids_unseen: float = Field(description="share of its inner surface without scan points near, interpolated")
    ids_gap: float = Field(description="area of the largest connected piece of inner surface without scan points near")
    intact_share: float = Field(description="share of the removed skin, rim included, that intact points lie on")
    consistent: bool = Field(description="whether the scan agrees with the damage volume")
    reasons: list[str] = Field(description="why it is not")


class VerdictReport(_Model):
    level: Literal["proven", "likely", "doubtful"]
    reasons: list[str] = Field(description="what speaks against it, or could not be tested")


class UnseenReport(_Model):
    area: float
    centre: Vector
    bounds: tuple[Vector, Vector]
    faces: list[int] = Field(description="numbers of its CAD faces; empty without B-rep")
    volume: float = Field(description="of the part behind it: the most that can be lost without a trace in the scan")
    why: Literal["unknown", "hidden", "outside", "no points"] = Field(
        description="hidden: by the part itself; outside: of every view; no points: though a view shows its place; "
        "unknown: no scanner position is known"
    )


class CoverageReport(_Model):
    seen: float = Field(description="share of the skin's area that the scan shows, or shows to be lost")
    unseen: list[UnseenReport] = Field(description="connected regions without scan points, largest first")


class FilesReport(_Model):
    """Where the job asks for several formats or frames, the first of them; `every` has them all."""

    damage: str | None
    surface: str | None
    deposit: str | None
    every: list[str] = Field(description="all files of this site alone")


class SplineReport(_Model):
    deviation: float | None = Field(description="largest distance between surface and spline, either way")
    trimmed: bool = Field(description="whether it ends at the surface's rim; otherwise it reaches beyond")
    reason: str = Field(description="why none was written; empty where one was")


class ExportReport(_Model):
    files: list[str] = Field(description="all that were written; those below scan_frame/ are in the scan's frame")
    notes: list[str] = Field(description="what was written in another way than asked for, and why")


class ThicknessReport(_Model):
    """Height of the stock over the nominal surface, where stock was asked for."""

    min: float
    mean: float
    max: float


class DepositReport(_Model):
    volume: float = Field(description="of what is to be deposited")
    stock_volume: float = Field(description="of its share beyond the nominal surface, to be milled off")
    cut_back_volume: float = Field(description="of intact metal to be removed before, for a clean surface")
    thickness: ThicknessReport | None = Field(description="of the stock; null where none was asked for or measured")
    faces: list[int] = Field(description="numbers of the CAD faces that stock stands on; empty without B-rep")


class MaterialReport(_Model):
    """Sums over all sites except those that the stage allowance refused."""

    deposit_volume: float
    stock_volume: float
    cut_back_volume: float


class SiteReport(_Model):
    id: int
    points: int
    volume: float = Field(description="of the damage volume, enlarged by the cut-back where there is one")
    surface_area: float = Field(description="of the inner damage surface")
    max_depth: float = Field(description="of the scan below the nominal surface")
    volume_rates: list[float] = Field(description="change of the volume for each unit of each motion of alignment.free")
    centroid: Vector
    bounds: tuple[Vector, Vector]
    method: str = Field(description="surface: site by site; otherwise the implementation that took all sites at once")
    evidence: EvidenceReport
    verdict: VerdictReport
    accepted: bool = Field(description="whether it is part of damage_volume; a doubtful site is where the job says so")
    deposit: DepositReport | None = Field(
        description="null where the stage allowance refused the site, or it is not accepted"
    )
    files: FilesReport
    spline: SplineReport | None = Field(description="null where the job asks for none")
    warnings: list[str]


class SurplusReport(_Model):
    """Matter outside the nominal surface."""

    id: int
    kind: Literal["surplus", "displaced piece", "surroundings"] = Field(
        description="surplus: added metal or dirt; displaced piece: losses of like size are beside it; surroundings: a "
        "fixture, a table or a second specimen"
    )
    points: int
    share: float = Field(description="of the scan's points")
    volume: float | None = Field(description="null where it does not close, and for surroundings")
    height: float = Field(description="largest distance of its points from the nominal surface")
    area: float = Field(description="of the skin that it covers")
    centre: Vector = Field(description="of the bounds")
    bounds: tuple[Vector, Vector] = Field(description="of the volume; of the points where there is none")
    file: str | None = Field(description="the first one of the volume; null where there is none")
    beside: list[int] = Field(description="numbers of the sites beside it")
    notes: list[str]


class TruthReport(_Model):
    """Only after a virtual scan: how far the result is from the known truth."""

    volume: float
    iou: float = Field(description="intersection over union of found and true damage")
    transform: list[list[float]] = Field(description="the true T_part_scan")


class StageReport(_Model):
    stage: str
    use: str
    provider: str
    site: int = Field(description="0 for a stage that runs once per job")
    seconds: float
    cached: bool


class Report(_Model):
    """The content of result.json. Lengths, areas and volumes in ``units``; coordinates in the part's frame."""

    version: Literal[1] = Field(1, alias="schema", description="version of this format")
    status: Literal["ok", "incomplete"] = Field(description="incomplete: some sites have no damage volume or deposit")
    name: str
    units: str
    tolerance: float
    part: PartReport
    scan: ScanReport
    alignment: AlignmentReport
    coverage: CoverageReport | None
    sites: list[SiteReport]
    surplus: list[SurplusReport] = Field(description="what lies outside the nominal surface, surroundings last")
    export: ExportReport
    damage_volume: float
    undamaged_volume: float
    material: MaterialReport = Field(description="what the whole repair takes")
    truth: TruthReport | None
    stages: list[StageReport]
    failures: list[str] = Field(description="sites without a damage volume or a deposit, and why")
    warnings: list[str]
    versions: dict[str, str]


def result_schema() -> dict[str, Any]:
    """The JSON Schema of result.json."""
    return {"$schema": DIALECT, **Report.model_json_schema(mode="serialization"), "title": "damageest result"}


def build_report(result: Result, written: ExportedFiles = _NOTHING, relative: Any = str) -> dict[str, Any]:
    """The content of result.json as plain values. ``relative`` turns an absolute input path into the one to write."""
    import platform
    from importlib.metadata import version

    part, scan, pose = result.part, result.scan, result.pose
    sites = [_report_site(site, written) for site in result.sites]
    filled = Report(
        status=result.status,
        name=result.name,
        units=result.units,
        tolerance=result.tolerance,
        part=PartReport(
            path=relative(part.path) if part.path else "",
            sha256=part.sha256,
            volume=part.volume,
            watertight=True,
            tessellation_error=part.tessellation_error,
            notes=list(part.notes),
        ),
        scan=ScanReport(
            paths=[relative(path) for path in scan.paths],
            points=len(scan.points),
            noise=scan.noise,
            spacing=scan.spacing,
            notes=list(scan.notes),
        ),
        alignment=AlignmentReport(
            transform=pose.T_part_scan.tolist(),
            quaternion=_to_quaternion(pose.T_part_scan),
            translation=tuple(pose.T_part_scan[:3, 3].tolist()),
            rms=pose.rms,
            inliers=pose.inliers,
            alternatives=[] if pose.alternatives is None else pose.alternatives.tolist(),
            notes=list(pose.notes),
            doubts=list(pose.doubts),
            free=[report_free_motion(motion) for motion in pose.free],
            held=pose.is_held,
        ),
        coverage=_report_coverage(result.coverage),
        sites=sites,
        surplus=[_report_surplus(item, result, written) for item in result.surplus],
        export=ExportReport(files=list(written.files), notes=list(written.notes)),
        damage_volume=result.damage_volume,
        undamaged_volume=result.undamaged_volume,
        material=_sum_material([site.deposit for site in sites if site.deposit]),
        truth=_report_truth(result),
        stages=[StageReport(**vars(record)) for record in result.stages],
        failures=list(result.failures),
        warnings=list(result.warnings),
        versions={"damageest": version("damageest"), "python": platform.python_version()},
    )
    return filled.model_dump(mode="json", by_alias=True)


def _to_quaternion(T: Floats) -> tuple[float, float, float, float]:
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(T[:3, :3]).as_quat(canonical=True).tolist()
    return w, x, y, z


def _report_coverage(coverage: Coverage | None) -> CoverageReport | None:
    if coverage is None:
        return None
    regions = []
    for region in coverage.unseen:
        low, high = region.bounds.tolist()
        regions.append(
            UnseenReport(
                area=region.area,
                centre=tuple(region.centre.tolist()),
                bounds=(tuple(low), tuple(high)),
                faces=list(region.faces),
                volume=region.volume,
                why=region.why,
            )
        )
    return CoverageReport(seen=coverage.seen, unseen=regions)


def _report_site(site: Site, written: ExportedFiles) -> SiteReport:
    kinds = ("damage", "surface", "deposit")
    folders = dict(zip(kinds, kinds if site.accepted else ("doubtful", "doubtful/surface", "deposit"), strict=True))
    own = {
        kind: [f for f in written.files if f.removeprefix("scan_frame/").startswith(f"{folder}/site-{site.id}.")]
        for kind, folder in folders.items()
    }
    spline = written.splines.get(site.id)

    low, high = site.damage.bounds.tolist()
    evidence = {name: value for name, value in vars(site.evidence).items() if name not in ("reasons", "causes")}
    return SiteReport(
        id=site.id,
        points=len(site.points),
        volume=site.damage.volume,
        surface_area=site.surface.area,
        max_depth=site.max_depth,
        volume_rates=list(site.volume_rates),
        centroid=tuple(site.centroid.tolist()),
        bounds=(tuple(low), tuple(high)),
        method=site.method,
        deposit=_report_deposit(site),
        evidence=EvidenceReport(**evidence, reasons=list(site.evidence.reasons)),
        verdict=VerdictReport(level=site.verdict.level, reasons=list(site.verdict.reasons)),
        accepted=site.accepted,
        files=FilesReport(
            **{kind: next(iter(own[kind]), None) for kind in kinds}, every=[f for kind in kinds for f in own[kind]]
        ),
        spline=SplineReport(**vars(spline)) if spline else None,
        warnings=list(site.warnings),
    )


def _report_surplus(item: Surplus, result: Result, written: ExportedFiles) -> SurplusReport:
    points = result.aligned.points[item.points]
    bounds = np.array([points.min(axis=0), points.max(axis=0)]) if item.solid is None else item.solid.bounds
    low, high = bounds.tolist()
    own = [f for f in written.files if f.removeprefix("scan_frame/").startswith(f"surplus/site-{item.id}.")]
    return SurplusReport(
        id=item.id,
        kind=item.kind,
        points=len(item.points),
        share=item.share,
        volume=item.volume,
        height=item.height,
        area=item.area,
        centre=tuple(bounds.mean(axis=0).tolist()),
        bounds=(tuple(low), tuple(high)),
        file=next(iter(own), None),
        beside=[site.id for site in result.sites if set(site.clusters) & set(item.clusters)],
        notes=list(item.notes),
    )


def _report_deposit(site: Site) -> DepositReport | None:
    if site.refused or not site.accepted:
        return None
    deposit = site.deposit or site.damage
    if not isinstance(deposit, Deposit):
        stock = deposit.volume - site.damage.volume
        return DepositReport(volume=deposit.volume, stock_volume=stock, cut_back_volume=0, thickness=None, faces=[])
    low, mean, high = deposit.thickness or (0.0, 0.0, 0.0)
    return DepositReport(
        volume=deposit.volume,
        stock_volume=deposit.stock_volume,
        cut_back_volume=deposit.cut_back_volume,
        thickness=ThicknessReport(min=low, mean=mean, max=high) if deposit.thickness else None,
        faces=list(deposit.touched),
    )


def _sum_material(deposits: list[DepositReport]) -> MaterialReport:
    return MaterialReport(
        deposit_volume=sum(deposit.volume for deposit in deposits),
        stock_volume=sum(deposit.stock_volume for deposit in deposits),
        cut_back_volume=sum(deposit.cut_back_volume for deposit in deposits),
    )


def _report_truth(result: Result) -> TruthReport | None:
    truth = result.scan.truth
    if truth is None or result.truth is None:
        return None
    volume, iou = result.truth.tolist()
    return TruthReport(volume=volume, iou=iou, transform=truth.T_part_scan.tolist())
