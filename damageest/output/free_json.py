"""What result.json says of motions that unworn skin does not exclude."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

from damageest.artefacts import FreeMotion, Vector


class FreeMotionReport(BaseModel):
    """One motion of the scan after which it fits as well."""

    model_config = ConfigDict(extra="forbid", defer_build=True)

    direction: Vector = Field(description="of a shift, or of the axis of a turn; unit vector in the part's frame")
    point: Vector | None = Field(description="on the axis of a turn; null for a shift")
    low: float = Field(
        description="how far back, in the job's unit; of a turn: movement of the skin farthest from the axis"
    )
    high: float = Field(description="how far forth")
    turn: float = Field(description="angle in radians for each unit of movement; 0 for a shift")
    text: str


def report_free_motion(motion: FreeMotion) -> FreeMotionReport:
    """The entry of a motion."""
    return FreeMotionReport(**vars(motion))
