"""What result.json says of a site."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pydantic import Field

from damageest.artefacts import Deposit, Evidence, Vector
from damageest.findings import Verdict
from damageest.output.base import JsonModel, strip_frame
from damageest.output.path_json import PathReport, report_path
from damageest.output.uncertainty_json import ReportedInterval
from damageest.result import Site
from damageest.stages.export import DepositForm, ExactForm, ExportedFiles, MilledForm, Spline


class EvidenceReport(JsonModel, of=Evidence):
    causes: list[str]


class VerdictReport(JsonModel, of=Verdict): ...


class FilesReport(JsonModel):
    """Where the job asks for several formats or frames, the first of them; `every` has them all."""

    damage: str | None
    surface: str | None
    deposit: str | None
    milled: str | None = Field(description="intact metal to be milled off before deposition; null without `prepare`")
    every: list[str] = Field(
        description="all files of this site alone; the names of those that other programs may refuse end in -invalid"
    )


class SplineReport(JsonModel, of=Spline): ...


class ExactDepositReport(JsonModel, of=DepositForm):
    """Whether the deposit in STEP has the CAD's own faces and their offsets."""


class ExactMilledReport(JsonModel, of=MilledForm):
    """Whether the metal that is milled off before deposition has the CAD's own faces in STEP."""


class ExactReport(JsonModel, of=ExactForm):
    """Whether the solid in STEP has the CAD's own faces."""


class ThicknessReport(JsonModel):
    """Height of the stock over the nominal surface, on skin with stock."""

    min: float
    mean: float
    max: float


class DepositReport(JsonModel, of=Deposit, fields="volume stock_volume cut_back_volume thickness faces"):
    volume: float = Field(description="volume to deposit")
    stock_volume: float
    cut_back_volume: float
    thickness: ThicknessReport | None
    faces: list[int] = Field(description="numbers of the CAD faces that stock stands on; empty without B-rep")


class MaterialReport(JsonModel):
    """Sums over all sites except those that the stage allowance refused."""

    deposit_volume: float
    stock_volume: float
    cut_back_volume: float


class SiteReport(
    JsonModel,
    of=Site,
    fields="id points volume volume_95 depth_95 uncertainty surface_area max_depth volume_rates centroid bounds method "
    "evidence verdict accepted deposit path files spline exact warnings",
):
    points: int
    volume: float = Field(description="damage volume, enlarged by the cut-back if there is one")
    volume_95: ReportedInterval | None = Field(
        description="95 % interval of `volume`, its high end null where nothing limits it; null where there is none"
    )
    depth_95: ReportedInterval | None = Field(description="95 % interval of the largest depth, before a cut-back")
    surface_area: float = Field(description="area of the inner damage surface")
    centroid: Vector
    bounds: tuple[Vector, Vector]
    deposit: DepositReport | None = Field(
        description="null where the stage allowance refused the site, or it is not accepted"
    )
    path: PathReport | None
    files: FilesReport
    spline: SplineReport | None = Field(description="null: no spline in the job")
    exact: ExactReport | None = Field(description="null: no STEP in the job, or no CAD faces")


def index_files(files: Iterable[str]) -> dict[str, list[str]]:
    """The files by their path up to the first dot, in any frame."""
    found: dict[str, list[str]] = {}
    for name in files:
        found.setdefault(strip_frame(name).partition(".")[0], []).append(name)
    return found


def report_site(site: Site, written: ExportedFiles, files: Mapping[str, list[str]]) -> SiteReport:
    """``files``: as `index_files` gives them."""
    kinds = ("damage", "surface", "deposit", "milled")
    folders = {kind: kind for kind in kinds}
    if not site.accepted:
        folders |= {"damage": "doubtful", "surface": "doubtful/surface"}
    own = {kind: files.get(f"{folder}/site-{site.id}", []) for kind, folder in folders.items()}
    refused = {kind: files.get(f"{folder}/site-{site.id}-invalid", []) for kind, folder in folders.items()}
    return SiteReport.read(
        site,
        points=len(site.points),
        volume=site.damage.volume,
        surface_area=site.surface.area,
        bounds=site.damage.bounds,
        deposit=_report_deposit(site),
        path=report_path(site, written),
        files=FilesReport(
            **{kind: next(iter(own[kind]), None) for kind in kinds},
            every=[f for kind in kinds for f in (*own[kind], *refused[kind])],
        ),
        spline=written.splines.get(site.id),
        exact=written.exact.get(site.id),
    )


def _report_deposit(site: Site) -> DepositReport | None:
    if site.refused or not site.accepted:
        return None
    deposit = site.deposit or site.damage
    if not isinstance(deposit, Deposit):
        stock = deposit.volume - site.damage.volume
        return DepositReport(volume=deposit.volume, stock_volume=stock, cut_back_volume=0, thickness=None, faces=[])
    thickness = dict(zip(("min", "mean", "max"), deposit.thickness, strict=True)) if deposit.thickness else None
    return DepositReport.read(deposit, thickness=thickness, faces=deposit.touched)


def sum_material(deposits: list[DepositReport]) -> MaterialReport:
    return MaterialReport(
        deposit_volume=sum(deposit.volume for deposit in deposits),
        stock_volume=sum(deposit.stock_volume for deposit in deposits),
        cut_back_volume=sum(deposit.cut_back_volume for deposit in deposits),
    )
