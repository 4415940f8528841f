"""What result.json says of motions that unworn skin does not exclude."""

from __future__ import annotations

from pydantic import Field

from damageest.artefacts import Vector
from damageest.output.base import JsonModel


class FreeMotionReport(JsonModel):
    """One motion of the scan after which it fits as well."""

    direction: Vector = Field(description="of a shift, or of the axis of a turn; unit vector in the part's frame")
    point: Vector | None = Field(description="on the axis of a turn; null for a shift")
    low: float = Field(
        description="how far back, in the job's unit; of a turn: movement of the skin farthest from the axis"
    )
    high: float = Field(description="how far forth")
    turn: float = Field(description="angle in radians for each unit of movement; 0 for a shift")
    text: str
