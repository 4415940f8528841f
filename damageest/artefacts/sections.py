"""Sections through a part: contours as designed and as scanned, and what was measured on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from damageest.artefacts.arrays import Floats, Vector
from damageest.artefacts.fields import Checked, Count, NotNegative, Shape, Share

SECTION_KINDS = ("blade", "round", "contour", "line", "none")
"""What a section shows: an aerofoil; circles; any other outline; skin along a line; nothing of the part."""


@dataclass(frozen=True)
class SectionValue(Checked):
    """One quantity of a section."""

    name: str
    nominal: Annotated[float | None, "value as designed"]
    measured: Annotated[float | None, "value as scanned; null where the scan does not show it"]
    error: Annotated[NotNegative, "standard uncertainty of `measured`"] = 0.0
    unit: Annotated[str, "length: the job's unit"] = "length"
    note: Annotated[str, "why there is no value, or its range of validity; else empty"] = ""

    @property
    def difference(self) -> float | None:
        """Measured less nominal."""
        return None if self.nominal is None or self.measured is None else self.measured - self.nominal


@dataclass(frozen=True, eq=False)
class SectionContour(Checked):
    """One outline in the plane of a section, closed unless it is a ``line``, in the plane's coordinates.

    ``nominal`` (K,2): stations on the part as designed, counter-clockwise round metal. ``normals`` (K,2): outward unit
    vectors there. ``distance`` (K,): how far the scan lies outside it, NaN where it has no points. ``error`` (K,):
    standard uncertainty of that by the noise. ``counts`` (K,): points that it was measured from.
    """

    nominal: Annotated[Floats, Shape("K", 2)]
    normals: Annotated[Floats, Shape("K", 2, finite=False)]
    distance: Annotated[Floats, Shape("K", finite=False)]
    error: Annotated[Floats, Shape("K", finite=False)]
    counts: Annotated[Floats, Shape("K", finite=False)]

    @property
    def measured(self) -> Floats:
        """(K,2) the places of the scan at the stations, NaN where it has no points."""
        return np.asarray(self.nominal + self.distance[:, None] * self.normals)

    @property
    def lengths(self) -> Floats:
        """(K,) how far along the outline each station is."""
        steps = np.linalg.norm(np.diff(self.nominal, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True, eq=False)
class Section(Checked):
    """A section of part and scan, in the part's frame. ``kind``: one of `SECTION_KINDS`. ``marks``: places in the plane
    to draw, by name. ``points``: the scan points that were used."""

    number: int
    name: str
    kind: Annotated[str, "none: nothing of the part is here"]
    origin: Annotated[Vector, "zero of the plane's coordinates"]
    along: Annotated[Vector, "first axis of the plane, unit vector; of a line its direction"]
    out: Annotated[Vector, "second axis of the plane, unit vector"]
    across: Annotated[Vector, "normal of the plane, unit vector"]
    contours: tuple[SectionContour, ...] = ()
    values: tuple[SectionValue, ...] = ()
    group: Annotated[int, "number, from 1, of the item of the job's `sections`"] = 1
    seen: Annotated[Share, "share of the outlines that the scan shows"] = 0.0
    slab: Annotated[NotNegative, "scan points within this distance of the plane were used"] = 0.0
    points: Count = 0
    marks: tuple[tuple[str, float, float], ...] = ()
    notes: tuple[str, ...] = ()

    def value(self, name: str) -> SectionValue:
        """The quantity of this name. Raises KeyError where it was not asked for."""
        found = next((each for each in self.values if each.name == name), None)
        if found is None:
            raise KeyError(f"section {self.number} has no '{name}'; it has: {', '.join(v.name for v in self.values)}")
        return found

    def to_part(self, flat: Floats) -> Floats:
        """Places (N,2) of the plane in the part's frame (N,3)."""
        return np.asarray(np.array(self.origin) + flat @ np.array([self.along, self.out]))
