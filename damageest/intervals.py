"""95 % intervals as values and as text, with the budget of uncertainty that each is the sum of.

A text beside a type is what the schema of result.json says of the field."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

Interval = tuple[float, float]
"""Low and high end; a high end of infinity is open: nothing that was seen limits it."""


def describe_interval(interval: Interval | None) -> str:
    """As "98.2 to 101" or "at least 98.2"; a dash where there is none. Both ends have two digits of half the width."""
    if interval is None:
        return "–"
    low, high = interval
    if not math.isfinite(high):
        return f"at least {write_digits(low, 2)}"
    last = find_last(interval)
    return f"{write_to(low, last)} to {write_to(high, last)}"


def find_last(interval: Interval) -> int:
    """The power of ten of the last digit that an interval bears: the second one of half its width."""
    half = (interval[1] - interval[0]) / 2
    return math.floor(math.log10(half)) - 1 if half > 0 else -2


def write_to(value: float, last: int) -> str:
    """A number rounded to a power of ten, without an exponent."""
    return f"{round(value, -last):.{max(-last, 0)}f}"


def write_digits(value: float, digits: int) -> str:
    """A number with some digits, without an exponent."""
    return write_to(value, math.floor(math.log10(abs(value))) - digits + 1) if value else "0"


def describe_volume(volume: float, interval: Interval | None) -> str:
    """A volume with the digits that its interval bears: two of half its width, but two to six of the volume. Of a
    volume with an open interval two, since nothing limits it above."""
    if interval is None or volume <= 0:
        return write_digits(volume, 4)
    if not math.isfinite(interval[1]):
        return write_digits(volume, 2)
    digits = math.floor(math.log10(volume)) - find_last(interval) + 1
    return write_digits(volume, min(max(digits, 2), 6))


@dataclass(frozen=True)
class BudgetRow:
    """A source of uncertainty, in the terms of JCGM 100 (GUM)."""

    source: Annotated[str, "name of the source, the same from version to version"]
    text: str
    type: Annotated[Literal["A", "B"], "A: from this scan by statistics; B: from other knowledge"]
    distribution: Literal["normal", "rectangular"]
    uncertainty: Annotated[float, "standard uncertainty of the source, in `unit`"]
    unit: Annotated[str, "unit of the source; empty for a share, for example a scale"]
    sensitivity: Annotated[float, "change of the result for each unit of the source"]
    contribution: Annotated[float, "standard uncertainty of the result by this source"]
    share: Annotated[float, "share of the variance of the result, 0 to 1"]


@dataclass(frozen=True)
class BudgetBound:
    """A bound that moves an end of the interval beyond the expanded uncertainty, at most."""

    source: str
    text: str
    low: Annotated[float, "change of the low end of the interval, null: unlimited"]
    high: Annotated[float, "change of the high end of the interval"]


@dataclass(frozen=True)
class Budget:
    """A budget of uncertainty. ``bounds`` are no part of it: they move the ends of the 95 % interval."""

    rows: tuple[BudgetRow, ...]
    combined: Annotated[float, "combined standard uncertainty"]
    k: Annotated[float, "coverage factor, of 95 %"]
    expanded: Annotated[float, "expanded uncertainty: `k` times `combined`"]
    correction: Annotated[float, "correction by the mean error: the middle of the interval is the value plus this"] = (
        0.0
    )
    bounds: tuple[BudgetBound, ...] = ()


@dataclass(frozen=True)
class Fading:
    """Volumes of a shallow loss, counted only where it is deep enough."""

    half: Annotated[float, "volume deeper than half the tolerance"]
    at: Annotated[float, "volume deeper than the tolerance"]
    twice: Annotated[float, "volume deeper than twice the tolerance"]
    beyond: Annotated[float, "lost beyond the rim of the site, shallower still; not part of `volume`"]


@dataclass(frozen=True)
class Uncertainty:
    """How exactly a site's volume and its largest depth are known, and by which causes.

    ``volume_95``, ``depth_95``: the 95 % intervals; None where no scan points lie on the inner surface.
    ``extrapolated_error``: largest standard deviation of the adapted skin over ``extrapolated``. ``certain``: volume of
    the piece that is lost also where the errors are a quarter larger.
    """

    volume_95: Interval | None
    depth_95: Interval | None
    noise: Annotated[float, "noise of the points on the inner surface"] = 0.0
    spacing: Annotated[float, "surface between the points, above all beside the rim"] = 0.0
    rim: Annotated[float, "line where the inner surface meets the skin"] = 0.0
    pose: Annotated[float, "pose of the scan"] = 0.0
    tessellation: Annotated[float, "tessellation of the CAD surface"] = 0.0
    form: Annotated[float, "deviation of skin over whole areas"] = 0.0
    outward: Annotated[float, "skin as far outside the part"] = 0.0
    views: Annotated[float, "disagreement of overlapping views"] = 0.0
    adapt: Annotated[float, "adaptation of the part; 0: not adapted"] = 0.0
    extrapolated: Annotated[float, "length, no deviation: how far that field goes on beyond intact skin here"] = 0.0
    extrapolated_error: float = 0.0
    free: Annotated[Interval, "least and largest change"] = (0.0, 0.0)
    inside: Annotated[float, "inner surface without points"] = 0.0
    beside: Annotated[float, "unseen skin beside the site"] = 0.0
    probing_form: Annotated[float, "probing form error of the scanner's certificate, beyond the noise"] = 0.0
    scanner: Annotated[float, "other figures of the certificate, and the temperature of the part"] = 0.0
    budget: Annotated[Budget | None, "budget of the volume, source by source; null where nothing was measured"] = None
    depth_budget: Annotated[Budget | None, "budget of the largest depth"] = None
    fading: Annotated[Fading | None, "volumes of a shallow loss by counted depth; null for a sharp rim"] = None
    certain: float = 0.0

    def measure(self, term: str) -> float:
        """The standard deviation of the volume by a term; that of a plugin is in the budget alone. 0 where it has
        none."""
        if term in vars(self):
            return float(getattr(self, term))
        rows = self.budget.rows if self.budget else ()
        return next((row.contribution for row in rows if row.source == term), 0.0)

    @property
    def is_open(self) -> bool:
        """Whether the scan leaves the size of the loss without an upper limit."""
        return self.volume_95 is not None and math.isinf(self.volume_95[1])
