"""What the checks find out about a result, as values: verdict, coverage, surplus, model fit, uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

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
    """Connected skin without scan points.

    ``centre`` (3,) and ``bounds`` (2,3) of its cells; ``faces``: numbers of its CAD faces, empty where the part has
    none; ``volume``: the most that can be lost behind it without a trace in the scan. ``why``: `hidden`: the part
    itself is between it and every scanner position; `outside`: no view reached there; `no points`: a view reached there
    and gave no points; `unknown`: no scanner position is known; `earlier scan`: the part is one, and does not show it.
    """

    area: float
    centre: Floats
    bounds: Floats
    faces: tuple[int, ...]
    volume: float
    why: Literal["unknown", "hidden", "outside", "no points", "earlier scan"] = "unknown"


@dataclass(frozen=True, eq=False)
class Coverage:
    """What the scan shows of the part's skin.

    ``seen``: its share of the skin's area. ``skin``: the skin cut into cells, triangles of similar size, F of them.
    ``is_seen`` (F,): whether the scan has points on a cell; ``distance`` (F,): their mean signed distance, NaN where
    there are none; ``is_lost`` (F,): whether rays of the scanner passed through the metal behind it; ``region`` (F,):
    the cell's place in ``unseen``, -1 for a cell in none. ``unseen``: largest first.
    """

    seen: float
    unseen: tuple[UnseenRegion, ...]
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
    """Mean deviations of patches of skin of width ``size``: their standard deviation ``deviation``, the share that the
    noise of their points explains (``noise``), and the residual after removing the form of the fit (``left``)."""

    size: float
    deviation: float
    noise: float
    left: float


@dataclass(frozen=True, eq=False)
class ViewFit:
    """How one view lies against the part: ``shift`` (3,) of the part's centre and ``turn`` in degrees that would put it
    right, in the part's frame; ``apart``: how far it lies from the other views where they overlap; ``left``: the same
    after the views were fitted. ``is_determined``: whether skin and overlap fix its pose, ``held``: how many of the six
    motions they leave free, which are held. ``is_elsewhere``: whether it lies elsewhere than the others by more than
    noise; ``is_corrected``: whether it was moved to its place."""

    number: int
    shift: Floats
    turn: float
    apart: float
    left: float
    is_determined: bool
    is_corrected: bool
    held: int = 0
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
    """One source of a budget of uncertainty (JCGM 100): ``source``, and ``text`` for people; ``type``: A, from the scan
    by statistics, or B, from other knowledge. ``uncertainty``: standard uncertainty of the source, in ``unit`` ("" for
    a share); ``sensitivity``: change of the result for each unit of it; ``contribution``: standard uncertainty of the
    result by it; ``share`` of the variance."""

    source: str
    text: str
    type: Literal["A", "B"]
    distribution: Literal["normal", "rectangular"]
    uncertainty: float
    unit: str
    sensitivity: float
    contribution: float
    share: float


@dataclass(frozen=True)
class BudgetBound:
    """A bound that moves an end of the interval beyond the expanded uncertainty: ``low`` and ``high``, at most."""

    source: str
    text: str
    low: float
    high: float


@dataclass(frozen=True)
class Budget:
    """A budget of uncertainty of a volume or of a depth: its ``rows``, the ``combined`` standard uncertainty, and the
    ``expanded`` one with the coverage factor ``k``. ``correction``: of the mean error, to be added to the value.
    ``bounds`` are no part of it: they move the ends of the 95 % interval."""

    rows: tuple[BudgetRow, ...]
    combined: float
    k: float
    expanded: float
    correction: float = 0.0
    bounds: tuple[BudgetBound, ...] = ()


@dataclass(frozen=True)
class Fading:
    """A shallow loss whose edge fades out: its volume where it is deeper than ``half`` the tolerance, than the
    tolerance, ``at``, and than ``twice`` the tolerance; ``beyond``: what is lost beyond the rim of the site."""

    half: float
    at: float
    twice: float
    beyond: float


@dataclass(frozen=True)
class Uncertainty:
    """How exactly a site's volume and its largest depth are known.

    ``volume_95``, ``depth_95``: the 95 % intervals; None where no scan points lie on the inner surface. Causes, each as
    one standard deviation of the volume: ``noise`` of the points; ``spacing`` of the points, between which the inner
    surface is interpolated; ``rim``: where it meets the skin; ``pose`` as it was fitted; ``tessellation`` of the part;
    ``form`` of skin that deviates over whole areas; ``adapt``: the adaptation of the part, extrapolated at this site by
    ``extrapolated`` beyond intact skin, where its standard deviation is ``extrapolated_error`` at most; ``outward``:
    skin that lies as far outside; ``views`` that differ. ``free``: change of the volume at the ends of motions that the
    scan leaves free. ``inside``, ``beside``: by how much the loss may be larger at most where no points show the inner
    surface, and the skin beside it. ``fading``: None for a loss that is not shallow. ``probing_form``, ``scanner``: by
    the scanner's certificate, and by its other figures and the temperature together. ``budget``, ``depth_budget``: the
    same as tables; None where there is no interval. ``certain``: volume of the piece that is lost also where the errors
    are a quarter larger.
    """

    volume_95: Interval | None
    depth_95: Interval | None
    noise: float = 0.0
    spacing: float = 0.0
    rim: float = 0.0
    pose: float = 0.0
    tessellation: float = 0.0
    form: float = 0.0
    outward: float = 0.0
    views: float = 0.0
    adapt: float = 0.0
    extrapolated: float = 0.0
    extrapolated_error: float = 0.0
    free: Interval = (0.0, 0.0)
    inside: float = 0.0
    beside: float = 0.0
    fading: Fading | None = None
    probing_form: float = 0.0
    scanner: float = 0.0
    budget: Budget | None = None
    depth_budget: Budget | None = None
    certain: float = 0.0

    @property
    def is_open(self) -> bool:
        """Whether the scan leaves the size of the loss without an upper limit."""
        return self.volume_95 is not None and math.isinf(self.volume_95[1])


@dataclass(frozen=True)
class NoiseLevel:
    """The ``noise`` of points whose ``of`` (`incidence` in degrees, or `distance` from the scanner) lies between
    ``low`` and ``high``."""

    of: Literal["incidence", "distance"]
    low: float
    high: float
    noise: float


@dataclass(frozen=True)
class VariogramPoint:
    """Half the mean square by which the errors of two points differ, ``semivariance``, in the square of the job's unit,
    where they lie ``distance`` from each other."""

    distance: float
    semivariance: float


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
    """The errors of the sensor on intact skin, in the job's unit.

    ``noise``: standard deviation of single points; ``correlated``: of errors that neighbouring points share, over a
    region of ``alike`` across. ``depth_step``: 0 where the depth is continuous. ``stray``: share of the points that lie
    off the skin and belong to no site and no surplus. A loss that is shallower than ``least_depth`` or narrower than
    ``least_width`` cannot be seen. ``levels``: noise by incidence and by distance, where scanner positions are known.
    ``semivariogram``: how alike errors are, by the distance between the points, nearest first.
    """

    noise: float
    correlated: float
    alike: float
    depth_step: float
    stray: float
    least_depth: float
    least_width: float
    levels: tuple[NoiseLevel, ...] = ()
    semivariogram: tuple[VariogramPoint, ...] = ()
