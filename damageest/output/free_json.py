"""What result.json says of the pose's datums, and of motions that they or unworn skin do not fix."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import Vector
from damageest.output.base import JsonModel


class FreeMotionReport(JsonModel):
    """One motion of the scan after which it fits as well."""

    direction: Vector = Field(
        description="direction of a shift, or of the axis of a turn; unit vector in the part's frame"
    )
    point: Vector | None = Field(description="a point on the axis of a turn; null for a shift")
    low: float = Field(
        description="lower end of the motion, in the job's unit; of a turn: movement of the skin farthest from the axis"
    )
    high: float = Field(description="upper end of the motion, in the same")
    turn: float = Field(description="angle in radians for each unit of movement; 0 for a shift")
    text: str


class LeftMotionReport(JsonModel):
    """A motion that a datum system leaves free, and that the rest of the skin fixes."""

    direction: Vector = Field(
        description="direction of a shift, or of the axis of a turn; unit vector in the part's frame"
    )
    point: Vector | None = Field(description="a point on the axis of a turn; null for a shift")
    text: str


class DatumReport(JsonModel):
    """How a datum of a datum system was fitted."""

    name: str = Field(description="letter of the datum")
    kind: str = Field(description="shape, for example `plane`, or `3 cylinders` for a pattern")
    faces: list[int] = Field(description="numbers of its CAD faces; empty where the part is a mesh")
    takes: list[str] = Field(description="degrees of freedom that it fixes beyond earlier datums")
    points: int = Field(description="scan points on it")
    contact: float = Field(description="share of them on the fitted shape")
    inside: float = Field(description="share of them below the fitted shape, for example by wear")
    rms: float = Field(description="root mean square distance of patches in contact from the fitted shape")
    nominal: list[float] = Field(description="radius of each cylinder and sphere, as designed")
    measured: list[float] = Field(description="radius of each as fitted to the scan")
