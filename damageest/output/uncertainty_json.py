"""What result.json says about how exactly a site is known."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from damageest.output.base import Bound, JsonModel

ReportedInterval = tuple[float, Bound]


class BudgetRowReport(JsonModel):
    """A source of uncertainty, in the terms of JCGM 100 (GUM)."""

    source: str = Field(description="name of the source, the same from version to version")
    text: str
    type: Literal["A", "B"] = Field(description="A: from this scan by statistics; B: from other knowledge")
    distribution: Literal["normal", "rectangular"]
    uncertainty: float = Field(description="standard uncertainty of the source, in `unit`")
    unit: str = Field(description="unit of the source; empty for a share, for example a scale")
    sensitivity: float = Field(description="change of the result for each unit of the source")
    contribution: float = Field(description="standard uncertainty of the result by this source")
    share: float = Field(description="share of the variance of the result, 0 to 1")


class BudgetBoundReport(JsonModel):
    source: str
    text: str
    low: Bound = Field(description="change of the low end of the interval, null: unlimited")
    high: Bound = Field(description="change of the high end of the interval")


class BudgetReport(JsonModel):
    """A budget of uncertainty. `bounds` are no part of it: they move the ends of the 95 % interval."""

    rows: list[BudgetRowReport]
    combined: float = Field(description="combined standard uncertainty")
    k: float = Field(description="coverage factor, of 95 %")
    expanded: float = Field(description="expanded uncertainty: `k` times `combined`")
    correction: float = Field(
        description="correction by the mean error: the middle of the interval is the value plus this"
    )
    bounds: list[BudgetBoundReport]


class FadingReport(JsonModel):
    """Volumes of a shallow loss, counted only where it is deep enough."""

    half: float = Field(description="volume deeper than half the tolerance")
    at: float = Field(description="volume deeper than the tolerance")
    twice: float = Field(description="volume deeper than twice the tolerance")
    beyond: float = Field(description="lost beyond the rim of the site, shallower still; not part of `volume`")


class UncertaintyReport(JsonModel):
    """The causes. The first nine are standard deviations of the volume; `free`: its change at the ends of motions that
    the scan leaves free; the next two, how much larger it may be; `probing_form` and `scanner` are standard deviations
    again."""

    noise: float = Field(description="noise of the points on the inner surface")
    spacing: float = Field(description="surface between the points, above all beside the rim")
    rim: float = Field(description="line where the inner surface meets the skin")
    pose: float = Field(description="pose of the scan")
    tessellation: float = Field(description="tessellation of the CAD surface")
    form: float = Field(description="deviation of skin over whole areas")
    outward: float = Field(description="skin as far outside the part")
    views: float = Field(description="disagreement of overlapping views")
    adapt: float = Field(description="adaptation of the part; 0: not adapted")
    extrapolated: float = Field(description="length, no deviation: how far that field goes on beyond intact skin here")
    free: tuple[float, float] = Field(description="least and largest change")
    inside: float = Field(description="inner surface without points")
    beside: float = Field(description="unseen skin beside the site")
    probing_form: float = Field(description="probing form error of the scanner's certificate, beyond the noise")
    scanner: float = Field(description="other figures of the certificate, and the temperature of the part")
    budget: BudgetReport | None = Field(
        description="budget of the volume, source by source; null where nothing was measured"
    )
    depth_budget: BudgetReport | None = Field(description="budget of the largest depth")
    fading: FadingReport | None = Field(description="volumes of a shallow loss by counted depth; null for a sharp rim")
