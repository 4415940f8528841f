"""What a job says about the scans that are made after its repair, for `damageest inspect`."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from damageest.options import Options


class InspectChoice(Options):
    """How scans after a step of the repair are judged."""

    defect: float | None = Field(
        None,
        gt=0,
        description="width of the least defect that matters, in the job's unit; default: 15 tolerances",
    )
    elsewhere: Literal["decides", "listed"] = Field(
        "decides", description="what is found at no site makes the part not met (decides), or is only listed"
    )
