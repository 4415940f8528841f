"""What result.json says of unseen skin and of what lies outside it."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Vector
from damageest.findings import Surplus
from damageest.output.base import JsonModel, strip_frame
from damageest.result import Result
from damageest.stages.export import ExportedFiles


class UnseenReport(JsonModel):
    area: float
    centre: Vector
    bounds: tuple[Vector, Vector]
    faces: list[int] = Field(description="numbers of its CAD faces; empty without B-rep")
    volume: float = Field(description="volume of the part behind it: the largest loss that the scan cannot exclude")
    why: Literal["unknown", "hidden", "outside", "no points", "earlier scan"] = Field(
        description="hidden: by the part itself; outside: of every view; no points: though a view shows its place; "
        "unknown: no scanner position is known; earlier scan: the part is one, which does not show it either"
    )


class CoverageReport(JsonModel):
    seen: float = Field(description="share of the skin's area that the scan shows, or shows to be lost")
    unseen: list[UnseenReport] = Field(description="connected regions without scan points, largest first")


class SurplusReport(JsonModel):
    """Matter outside the nominal surface."""

    id: int
    kind: Literal["surplus", "displaced piece", "surroundings"] = Field(
        description="surplus: added metal or dirt; displaced piece: losses of like size are beside it; surroundings: a "
        "fixture, a table or a second specimen"
    )
    points: int
    share: float = Field(description="share of the scan's points")
    volume: float | None = Field(description="null where it does not close, and for surroundings")
    estimate: float = Field(description="estimated volume: area times mean height; 0 for surroundings")
    height: float = Field(description="largest distance of its points from the nominal surface")
    area: float = Field(description="area of the skin that it covers")
    centre: Vector = Field(description="centre of the bounds")
    bounds: tuple[Vector, Vector] = Field(description="bounds of the volume, else of the points")
    file: str | None = Field(description="the first one of the volume; null where there is none")
    beside: list[int] = Field(description="numbers of the sites beside it")
    notes: list[str]


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
