"""What a job may ask of sections."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, FiniteFloat, model_validator

from damageest.geometry.selectors import Direction, StrictMapping, Vector

PLACES = ("x", "y", "z", "plane", "along", "line")
"""The ways to say where a section is; one for each item."""


class PlanePlace(StrictMapping):
    """A plane."""

    point: Vector = Field(description="a point on the plane, in part coordinates, in the job's unit")
    normal: Direction = Field(description="normal of the plane; its length does not matter")


class LinePlace(StrictMapping):
    """A straight line beside the skin; depth is measured on the skin nearest to it."""

    start: Vector = Field(alias="from", description="first end of the line, in part coordinates, in the job's unit")
    end: Vector = Field(alias="to", description="other end of the line, in part coordinates, in the job's unit")

    @model_validator(mode="after")
    def _check_length(self) -> Self:
        if self.start == self.end:
            raise ValueError("the ends of a line must differ")
        return self


def _check_order(value: tuple[float, float]) -> tuple[float, float]:
    if not value[0] < value[1]:
        raise ValueError("give the lower end first; the other is larger")
    return value


class SectionChoice(StrictMapping):
    """One section, or several along an axis: give one of x, y, z, plane, along and line."""

    x: FiniteFloat | None = Field(None, description="a plane across x at this coordinate, in the job's unit")
    y: FiniteFloat | None = Field(None, description="a plane across y at this coordinate, in the job's unit")
    z: FiniteFloat | None = Field(None, description="a plane across z at this coordinate, in the job's unit")
    plane: PlanePlace | None = Field(None, description="any plane, by a point and its normal")
    along: Literal["axis", "x", "y", "z"] | Direction | None = Field(
        None,
        description="evenly spaced planes across this direction; axis: that of a turned part, else the longest",
    )
    count: int = Field(9, ge=1, le=200, description="number of planes of `along`")
    span: Annotated[tuple[FiniteFloat, FiniteFloat], AfterValidator(_check_order)] | None = Field(
        None,
        description="first and last plane of `along`, as coordinates along it in the part's frame, in the job's unit; "
        "default: evenly spaced within the part",
    )
    line: LinePlace | None = Field(None, description="depth of wear along a line instead of a section")
    kind: Literal["auto", "blade", "round", "contour"] = Field(
        "auto",
        description="quantities to measure; blade: an aerofoil's chord, thickness, twist and bow; round: "
        "diameter, run-out and roundness; contour: the deviation alone; auto: by the section as "
        "designed",
    )
    leading: Direction | None = Field(
        None, description="direction from an aerofoil's middle to its leading edge; default: to its blunter end"
    )
    name: str = Field("", max_length=80, description="name of the section; default: its position")

    @model_validator(mode="after")
    def _check_place(self) -> Self:
        given = [name for name in PLACES if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none"
            raise ValueError(f"give one of {', '.join(PLACES)}; this has {found}")
        unused = {"count", "span"} & self.model_fields_set
        if self.along is None and unused:
            raise ValueError(f"'{sorted(unused)[0]}' belongs to 'along'")
        return self
