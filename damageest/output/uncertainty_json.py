"""What result.json says about how exactly a site is known."""

from __future__ import annotations

from pydantic import Field

from damageest.output.base import Bound, JsonModel

ReportedInterval = tuple[float, Bound]


class FadingReport(JsonModel):
    """Volumes of a shallow loss, counted only where it is deep enough."""

    half: float = Field(description="where it is deeper than half the tolerance")
    at: float = Field(description="where it is deeper than the tolerance")
    twice: float = Field(description="where it is deeper than twice the tolerance")
    beyond: float = Field(description="lost beyond the rim of the site, shallower still; not part of `volume`")


class UncertaintyReport(JsonModel):
    """The causes. The first nine are standard deviations of the volume; `free`: its change at the ends of motions that
    the scan does not exclude; the next two, how much larger it may be."""

    noise: float = Field(description="noise of the points on the inner surface")
    spacing: float = Field(description="the surface between the points, above all beside the rim")
    rim: float = Field(description="where the inner surface meets the skin")
    pose: float = Field(description="pose of the scan")
    tessellation: float = Field(description="triangles in place of the CAD surface")
    form: float = Field(description="skin that deviates over whole areas")
    outward: float = Field(description="skin that lies as far outside the part")
    views: float = Field(description="views that differ where they overlap")
    adapt: float = Field(description="the field that the part was adapted by; 0 where it was not")
    extrapolated: float = Field(description="length, no deviation: how far that field goes on beyond intact skin here")
    free: tuple[float, float] = Field(description="least and largest change")
    inside: float = Field(description="where no points show the inner surface")
    beside: float = Field(description="where no points show the skin beside it")
    fading: FadingReport | None = Field(description="of a loss that is shallow; null for one with a sharp rim")
