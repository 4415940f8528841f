"""What result.json says of the distances of the scan points, of unseen skin, and of what lies outside it."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from damageest.artefacts import ADDED, DAMAGE, INTACT, OUTLIER, Deviation, Floats, Vector
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


PERCENTILES = (1, 5, 25, 50, 75, 95, 99)


class LabelReport(JsonModel):
    """Number of scan points by label."""

    intact: int
    damage: int = Field(description="in a site")
    added: int = Field(description="on surplus")
    outlier: int = Field(description="in no site and on no surplus")


class DeviationReport(JsonModel):
    """Signed distances of the scan points to the part's skin, positive outside."""

    labels: LabelReport
    percentiles: dict[str, float] = Field(description="percentiles of the distance of all points, by percent")
    intact_percentiles: dict[str, float] = Field(
        description="percentiles of the distance of the intact points, by percent"
    )


def report_deviation(deviation: Deviation) -> DeviationReport:
    """Counts the points of each label and gives percentiles of their distances; none where there are no points."""
    count = {
        name: int((deviation.label == label).sum())
        for name, label in (("intact", INTACT), ("damage", DAMAGE), ("added", ADDED), ("outlier", OUTLIER))
    }
    return DeviationReport(
        labels=LabelReport(**count),
        percentiles=_give_percentiles(deviation.distance),
        intact_percentiles=_give_percentiles(deviation.distance[deviation.label == INTACT]),
    )


def _give_percentiles(distance: Floats) -> dict[str, float]:
    if not len(distance):
        return {}
    values = np.percentile(distance, PERCENTILES).tolist()
    return {str(percent): value for percent, value in zip(PERCENTILES, values, strict=True)}
