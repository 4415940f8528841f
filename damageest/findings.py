"""What the checks find out about a result, as values: verdict, coverage, surplus, model fit, sensor.

A text beside a type is what the schema of result.json says of the field: the models of `output/` are made of these."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Flags, Floats, Ints, Mesh, Reason, Solid
from damageest.intervals import (
    Budget,
    BudgetBound,
    BudgetRow,
    Fading,
    Interval,
    Uncertainty,
    describe_interval,
    describe_volume,
    write_digits,
)

__all__ = [
    "DONE", "Budget", "BudgetBound", "BudgetRow", "Coverage", "Deformed", "Explained", "Fading", "Interval", "Level",
    "ModelFit", "NoiseLevel", "PatchDeviation", "Sensor", "Surplus", "Uncertainty", "UnseenRegion", "VariogramPoint",
    "Verdict", "ViewFit", "describe_interval", "describe_volume", "write_digits",
]  # fmt: skip

Level = Literal["proven", "likely", "doubtful"]


@dataclass(frozen=True)
class Verdict:
    """What a damage volume is worth: ``level``, and the ``reasons`` for it.

    `proven`: the 95 % interval of its volume is narrow, and nothing is open. `likely`: the interval, with all causes in
    it, excludes that nothing was lost, and the scan does not contradict it. `doubtful`: the interval reaches down to
    nearly nothing, or the scan contradicts it, or poses that fit differ in which metal is lost.
    """

    level: Level = "proven"
    reasons: Annotated[tuple[Reason, ...], "why, those first that change the verdict most"] = ()


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

    ``points`` (M,) indices into the scan; ``solid``: its volume as a closed mesh, None where it cannot be closed.
    ``clusters``: the point clusters of the losses beside it. ``notes`` say what was recognised. ``estimate``: the only
    volume of a surplus that is not closed.
    """

    id: int
    points: NDArray[np.int64]
    share: Annotated[float, "share of the scan's points"]
    solid: Solid | None
    height: Annotated[float, "largest distance of its points from the nominal surface"]
    area: Annotated[float, "area of the skin that it covers"]
    kind: Annotated[
        Literal["surplus", "displaced piece", "surroundings"],
        "surplus: added metal or dirt; displaced piece: losses of like size are beside it; surroundings: a "
        "fixture, a table or a second specimen",
    ] = "surplus"
    clusters: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    estimate: Annotated[float, "estimated volume: area times mean height; 0 for surroundings"] = 0.0

    @property
    def volume(self) -> float | None:
        """Null where it does not close, and for surroundings."""
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

    ``scale``, ``scale_error``, and ``scale_by_axis`` (3,) along ``axes`` (3,3, as rows): those of a model that is `ok`
    are within their errors and the scanner's. ``deformation``: kinds and amounts. `open`: no form was found, but there
    are other reasons against the part as designed in this pose.
    """

    model: Literal["ok", "scaled", "deformed", "views disagree", "wavy", "open"]
    words: Annotated[str, "the model with its amounts"]
    deviations: Annotated[tuple[PatchDeviation, ...], "at widths of 20, 50 and 100 tolerances, where the part has them"]
    scale: float
    scale_error: Annotated[float, "standard error of the scale"]
    axes: Annotated[Floats, "directions of by_axis, in the part's frame"]
    scale_by_axis: Floats
    scale_by_axis_error: Floats
    deformation: tuple[tuple[Deformed, float], ...]
    amount: Annotated[float, "largest displacement of the seen skin by the model; 0 where it is ok"]
    amount_error: Annotated[float, "standard error of the amount"]
    views: Annotated[tuple[ViewFit, ...], "empty where the views agree or are not known"]
    waviness: Annotated[float, "standard deviation that no model explains, inside and outside alike"]
    corrected_scale: Annotated[float, "the scale that was taken out of the scan before; 1: none"] = 1.0
    views_from: Annotated[
        Literal["given", "order", "sheets"],
        "source of the assignment of points to views: the scan, the order of the points, or two "
        "surfaces over the same skin",
    ] = "given"
    views_hidden: Annotated[
        float, "volume that may be worn off where only the part shows how corrected views were misplaced"
    ] = 0.0

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
