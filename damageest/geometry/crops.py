"""Crops of a scan: which points a person decides to keep, by simple shapes in the scan's frame and unit."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, Discriminator, Field, FiniteFloat, PositiveFloat, Tag, model_validator

from damageest.artefacts import Flags, Floats, Scan
from damageest.errors import InputError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.point_pieces import number_pieces
from damageest.options import Options

Place = tuple[FiniteFloat, FiniteFloat, FiniteFloat]

DEFAULT_GAP = 10.0
"""Largest gap within a piece where the job gives none, in point spacings."""


class Crop(Options, ABC):
    """Base of the crops: ``keep`` removes the points outside the shape, ``drop`` those inside. ``needs_all``: whether
    it has to see all points of a scan at once."""

    model_config = ConfigDict(defer_build=True)
    needs_all: ClassVar[bool] = False
    keep: str | None

    @abstractmethod
    def contains(self, points: Floats) -> Flags:
        """Whether each of the points (N,3) is inside the shape."""

    def describe(self) -> str:
        """The crop as text: 'keep box'."""
        return f"keep {self.keep}"


class _ShapeCrop(Crop):
    """Base of the crops whose inside may be kept or dropped."""

    keep: str | None = None
    drop: str | None = None

    @model_validator(mode="after")
    def _check_action(self) -> Self:
        if (self.keep is None) == (self.drop is None):
            raise ValueError("give either  keep: ...  or  drop: ...")
        return self

    def describe(self) -> str:
        """The crop as text: 'keep box'."""
        return super().describe() if self.keep else f"drop {self.drop}"


class BoxCrop(_ShapeCrop):
    """A box along the axes of the scan's frame."""

    keep: Literal["box"] | None = Field(None, description="keep what is in the box")
    drop: Literal["box"] | None = Field(None, description="remove what is in the box")
    min: Place = Field(description="lowest x, y and z, in the job's unit")
    max: Place = Field(description="highest x, y and z, in the job's unit")

    @model_validator(mode="after")
    def _check_corners(self) -> Self:
        for axis, low, high in zip("xyz", self.min, self.max, strict=True):
            if not low < high:
                raise ValueError(f"min is not below max in {axis}: {low:g} and {high:g}")
        return self

    def contains(self, points: Floats) -> Flags:
        """Whether each of the points (N,3) is inside the shape."""
        return np.asarray(((points >= self.min) & (points <= self.max)).all(axis=1))


class CylinderCrop(_ShapeCrop):
    """A cylinder from a point along an axis."""

    keep: Literal["cylinder"] | None = Field(None, description="keep what is in the cylinder")
    drop: Literal["cylinder"] | None = Field(None, description="remove what is in the cylinder")
    point: Place = Field(description="centre of one end, in the job's unit")
    axis: Place = Field(description="direction from that end to the other; its length does not matter")
    radius: PositiveFloat = Field(description="radius, in the job's unit")
    length: PositiveFloat = Field(description="length, in the job's unit")

    @model_validator(mode="after")
    def _check_axis(self) -> Self:
        _check_length(self.axis, "axis")
        return self

    def contains(self, points: Floats) -> Flags:
        """Whether each of the points (N,3) is inside the shape."""
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        way = points - np.array(self.point)
        along = way @ axis
        across = np.linalg.norm(way - along[:, None] * axis, axis=1)
        return np.asarray((along >= 0) & (along <= self.length) & (across <= self.radius))


class AboveCrop(_ShapeCrop):
    """The space on the side of a plane to which its normal points."""

    keep: Literal["above"] | None = Field(None, description="keep what is above the plane")
    drop: Literal["above"] | None = Field(None, description="remove what is above the plane")
    point: Place = Field(description="a point on the plane, in the job's unit")
    normal: Place = Field(
        (0.0, 0.0, 1.0), description="direction from the plane to what is above; its length does not matter"
    )

    @model_validator(mode="after")
    def _check_normal(self) -> Self:
        _check_length(self.normal, "normal")
        return self

    def contains(self, points: Floats) -> Flags:
        """Whether each of the points (N,3) is inside the shape."""
        return np.asarray((points - np.array(self.point)) @ np.array(self.normal) >= 0)


class PieceCrop(Crop):
    """The connected piece with the most points. Points no farther apart than `gap` are connected."""

    needs_all: ClassVar[bool] = True

    keep: Literal["largest piece"] = Field(description="keep the largest piece only")
    gap: PositiveFloat | None = Field(
        None, description="largest gap within a piece, in the job's unit; default: 10 distances between points"
    )

    def contains(self, points: Floats) -> Flags:
        """Whether each of the points (N,3) is inside the shape."""
        gap = self.gap or DEFAULT_GAP * measure_noise_and_spacing(points)[1]
        if not gap > 0 or not len(points):
            return np.ones(len(points), dtype=bool)
        piece = number_pieces(points, gap)
        return np.asarray(piece == np.bincount(piece).argmax())


def _check_length(direction: Place, name: str) -> None:
    if float(np.linalg.norm(direction)) < 1e-12:
        raise ValueError(f"{name}: a direction must have a length")


def _find_shape(value: Any) -> str | None:
    """The name of a crop's shape; None where it has none."""
    given = value if isinstance(value, dict) else getattr(value, "__dict__", {})
    shape = given.get("keep") or given.get("drop")
    known = shape in ("box", "cylinder", "above") or (shape == "largest piece" and bool(given.get("keep")))
    return f"crop {shape}" if known else None


AnyCrop = Annotated[
    Annotated[BoxCrop, Tag("crop box")]
    | Annotated[CylinderCrop, Tag("crop cylinder")]
    | Annotated[AboveCrop, Tag("crop above")]
    | Annotated[PieceCrop, Tag("crop largest piece")],
    Discriminator(
        _find_shape,
        custom_error_type="format",
        custom_error_message="give  keep: box, cylinder, above or largest piece,  or  drop: box, cylinder or above",
    ),
]


def crop_points(scan: Scan, crops: Sequence[Crop]) -> Scan:
    """The scan after the crops, in their order; its notes say how many points each removed.

    Raises InputError, which names the crop, where no point is left.
    """
    for number, crop in enumerate(crops, 1):
        inside = crop.contains(scan.points)
        kept = inside if crop.keep else ~inside
        name = f"crop {number} ({crop.describe()})"
        if not len(kept):
            raise InputError(f"scan: {name} leaves no points; there were none before it")
        if not kept.any():
            low, high = scan.points.min(axis=0), scan.points.max(axis=0)
            reach = ", ".join(f"{a:.4g} to {b:.4g} in {axis}" for a, b, axis in zip(low, high, "xyz", strict=True))
            raise InputError(
                f"scan: {name} leaves no points; before it, the points reach from {reach} ({scan.unit}). "
                "A crop is in the scan's own frame and in the job's unit"
            )
        note = f"{name}: removed {int((~kept).sum())} of {len(kept)} points"
        scan = replace(scan if kept.all() else scan.take(kept), notes=(*scan.notes, note))
    return scan
