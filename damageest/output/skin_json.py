"""What result.json says of unseen skin and of what lies outside it."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from damageest.artefacts import Vector
from damageest.findings import Coverage, Surplus, UnseenRegion
from damageest.output.base import JsonModel, strip_frame
from damageest.result import Result
from damageest.stages.export import ExportedFiles


class UnseenReport(JsonModel, of=UnseenRegion):
    centre: Vector
    bounds: tuple[Vector, Vector]


class CoverageReport(JsonModel, of=Coverage, without=("skin", "is_seen", "distance", "is_lost", "region")): ...


class SurplusReport(
    JsonModel,
    of=Surplus,
    fields="id kind points share volume estimate height area centre bounds file beside notes",
):
    """Matter outside the nominal surface."""

    points: int
    centre: Vector = Field(description="centre of the bounds")
    bounds: tuple[Vector, Vector] = Field(description="bounds of the volume, else of the points")
    file: str | None = Field(description="the first one of the volume; null where there is none")
    beside: list[int] = Field(description="numbers of the sites beside it")


def report_surplus(item: Surplus, result: Result, written: ExportedFiles) -> SurplusReport:
    points = result.aligned.points[item.points]
    bounds = np.array([points.min(axis=0), points.max(axis=0)]) if item.solid is None else item.solid.bounds
    own = [f for f in written.files if strip_frame(f).startswith(f"surplus/site-{item.id}.")]
    return SurplusReport.read(
        item,
        points=len(item.points),
        centre=bounds.mean(axis=0),
        bounds=bounds,
        file=next(iter(own), None),
        beside=[site.id for site in result.sites if set(site.clusters) & set(item.clusters)],
    )
