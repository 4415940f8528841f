"""What the checks find out about a result, as values: verdict, coverage, surplus, model fit, uncertainty.

A text beside a type is what the schema of result.json says of the field: the models of `output/` are made of these."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats, Ints, Mesh, Reason, Solid

Level = Literal["proven", "likely", "doubtful"]


@dataclass(frozen=True)
class Verdict:
    """What a damage volume is worth: ``level``, and the ``reasons`` for it.

    `proven`: the 95 % interval of its volume is narrow, and nothing is open. `likely`: the interval, with all causes in
    it, excludes that nothing was lost, and the scan does not contradict it. `doubtful`: the interval reaches down to
    nearly nothing, or the scan contradicts it, or poses that fit differ in which metal is lost.
    """

    level: Level = "proven"
    reasons: tuple[Reason, ...] = ()


@dataclass(frozen=True, eq=False)
class UnseenRegion:
    """Connected skin without scan points. ``centre`` (3,) and ``bounds`` (2,3) of its cells."""

    area: float
    centre: Floats
    bounds: Floats
    faces: Annotated[tuple[int, ...], "numbers of its CAD faces; empty without B-rep"]
    volume: Annotated[float, "volume of the part behind it: the largest loss that the scan cannot exclude"]
    why: Annotated[
        Literal["unknown", "hidden", "outside", "no points", "earlier scan"],
        "hidden: by the part itself; outside: of every view; no points: though a view shows its place; "
        "unknown: no scanner position is known; earlier scan: the part is one, which does not show it either",
    ] = "unknown"


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the scan shows of the part's skin.

    ``skin``: the skin cut into cells, triangles of similar size, F of them. ``is_seen`` (F,): whether the scan has
    points on a cell; ``distance`` (F,): their mean signed distance, NaN where there are none; ``is_lost`` (F,): whether
    rays of the scanner passed through the metal behind it; ``region`` (F,): the cell's place in ``unseen``, -1 for a
    cell in none.
    """

    seen: Annotated[float, "share of the skin's area that the scan shows, or shows to be lost"]
    unseen: Annotated[tuple[UnseenRegion, ...], "connected regions without scan points, largest first"]
    skin: Mesh
    is_seen: Flags
    distance: Floats
    is_lost: Flags
    region: Ints


@dataclass(frozen=True, eq=False)
class Surplus:
    """Metal or other matter outside the nominal surface.

    ``points`` (M,) indices into the scan, ``share`` of it; ``solid``: its volume as a closed mesh, None where it cannot
    be closed; ``height``: its largest distance from the skin; ``area``: skin that it covers. ``kind``: `surplus`, for
    example a weld bead or dirt; `displaced piece`, with losses of like size beside it; `surroundings`, for example a
    fixture, a table or a second specimen. ``clusters``: the point clusters of the losses beside it. ``notes`` say what
    was recognised. ``estimate``: estimated volume, the covered skin times its mean height, the only one for a surplus
    that is not closed; 0 for surroundings.
    """

    id: int
    points: NDArray[np.int64]
    share: float
    solid: Solid | None
    height: float
    area: float
    kind: Literal["surplus", "displaced piece", "surroundings"] = "surplus"
    clusters: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    estimate: float = 0.0

    @property
    def volume(self) -> float | None:
        return self.solid.volume if self.solid else None


@dataclass(frozen=True)
class PatchDeviation:
    """Mean deviations of patches of skin, by their width."""

    size: Annotated[float, "width of the patches of skin"]
    deviation: Annotated[float, "standard deviation of their mean distances from the part in the pose"]
    noise: Annotated[float, "standard deviation that the noise of their points explains"]
    left: Annotated[float, "standard deviation after removing the form that `model` names"]


@dataclass(frozen=True, eq=False)
class ViewFit:
    """How one view lies against the part. ``is_elsewhere``: whether it lies elsewhere than the others by more than
    noise. ``number`` is from 0 up here."""

    number: Annotated[int, "from 1 up, in the order of the scan's views"]
    shift: Annotated[Floats, "correction of the view: shift of the part's centre, in the part's frame"]
    turn: Annotated[float, "correction of the view: turn in degrees"]
    apart: Annotated[float, "distance from the other views where they overlap"]
    left: Annotated[float, "the same distance after the correction of views with a fixed pose"]
    is_determined: Annotated[bool, "whether its points and the overlap fix its pose"]
    held: Annotated[int, "number of motions, of six, that they leave free; these were held"]
    is_corrected: Annotated[bool, "whether the view was moved to its place"]
    is_elsewhere: bool = False


Deformed = Literal["bend", "twist", "shear", "stretch", "scale"]
DONE: dict[Deformed, str] = {
    "bend": "bent", "twist": "twisted", "shear": "sheared", "stretch": "stretched", "scale": "scaled"
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ModelFit:
    """How well the part as designed, in one rigid pose, explains the intact skin.

    ``scale``: length in the scan over length in the CAD, with its standard error; ``scale_by_axis`` (3,) along ``axes``
    (3,3, as rows); those of a model that is `ok` are within their errors and the scanner's. ``deformation``: kinds and
    amounts: the largest displacement of the seen skin beyond the rigid motion nearest to it, with ``amount`` for all
    together and ``amount_error``. ``waviness``: standard deviation that no form explains. ``corrected_scale``: the
    corrected scale of the scan, 1 for none. ``words``: all of it as text. `open`: no form was found, but there are
    other reasons against the part as designed in this pose. ``views_from``: whether the scan, the order of its points
    or two surfaces over the same skin define the views; ``views_hidden``: volume that may be worn off where only the
    part shows how views were misplaced that were moved.
    """

    model: Literal["ok", "scaled", "deformed", "views disagree", "wavy", "open"]
    words: str
    deviations: tuple[PatchDeviation, ...]
    scale: float
    scale_error: float
    axes: Floats
    scale_by_axis: Floats
    scale_by_axis_error: Floats
    deformation: tuple[tuple[Deformed, float], ...]
    amount: float
    amount_error: float
    views: tuple[ViewFit, ...]
    waviness: float
    corrected_scale: float = 1.0
    views_from: Literal["given", "order", "sheets"] = "given"
    views_hidden: float = 0.0

    @property
    def name(self) -> str:
        """The model as a short text."""
        if self.model == "scaled":
            return f"the scale is wrong by {100 * (self.scale - 1):+.3g} %"
        if self.model == "deformed":
            return "the part is " + " and ".join(DONE[kind] for kind, _ in self.deformation)
        return {
            "ok": "the part is as designed",
            "open": "no form was found",
            "views disagree": "the views of the scan disagree",
            "wavy": "the skin is wavy",
        }[self.model]


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

    @property
    def is_open(self) -> bool:
        """Whether the scan leaves the size of the loss without an upper limit."""
        return self.volume_95 is not None and math.isinf(self.volume_95[1])


@dataclass(frozen=True)
class NoiseLevel:
    """The noise of points whose angle of incidence, or distance, lies between ``low`` and ``high``."""

    of: Annotated[Literal["incidence", "distance"], "incidence in degrees, or distance from the scanner"]
    low: float
    high: float
    noise: float


@dataclass(frozen=True)
class VariogramPoint:
    """How much the errors of two points differ by their distance, in the square of the job's unit."""

    distance: Annotated[float, "distance between two intact points, mean of a range"]
    semivariance: Annotated[float, "half the mean square by which their errors differ"]


@dataclass(frozen=True)
class Explained:
    """Places below the skin that views which lie apart explain: how many, their number of ``points``, the ``volume``
    that they hold at most, and the depth of the ``deepest`` point, in the job's unit."""

    places: int = 0
    points: int = 0
    volume: float = 0.0
    deepest: float = 0.0


@dataclass(frozen=True)
class Sensor:
    """The errors of the sensor on intact skin, in the job's unit."""

    noise: Annotated[float, "standard deviation of single points"]
    correlated: Annotated[float, "standard deviation of errors that neighbouring points share"]
    alike: Annotated[float, "width of the regions that share them"]
    depth_step: Annotated[float, "0 where the depth is continuous"]
    stray: Annotated[float, "share of the points that lie off the skin and belong to no site and no surplus"]
    least_depth: Annotated[float, "shallower losses cannot be seen in this scan"]
    least_width: Annotated[float, "narrower losses cannot be seen in this scan"]
    levels: Annotated[tuple[NoiseLevel, ...], "empty where no scanner position is known"] = ()
    semivariogram: Annotated[tuple[VariogramPoint, ...], "semivariance of errors by distance, nearest first"] = ()
