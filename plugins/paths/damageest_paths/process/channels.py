"""What the process is given besides its place: power, powder or wire, gas and speed, by layer, pass and place."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, StringConstraints, model_validator

from damageest.artefacts import Flags, Floats
from damageest.options import Options

SPEED = "speed"
"""The channel that is the feed itself, in lengths a minute."""
KINDS = {"contour": ("ring", "rim"), "fill": ("row", "spiral", "gap")}
"""Names for several kinds of passes."""
Name = Annotated[str, StringConstraints(pattern="^[a-z][a-z0-9_]*$")]


class Span(Options):
    """Values from ``least`` to below ``most``."""

    least: float = Field(0.0, ge=0, description="smallest value")
    most: float | None = Field(None, gt=0, description="the value from which on the row does not hold; default: none")

    @model_validator(mode="after")
    def _check_order(self) -> Span:
        if self.most is not None and self.most <= self.least:
            raise ValueError(f"most ({self.most:g}) has to be above least ({self.least:g})")
        return self

    def holds(self, values: Floats) -> Flags:
        """Whether each of the values (N,) is within."""
        return np.asarray((values >= self.least) & (values < (np.inf if self.most is None else self.most)))


class Setting(Options):
    """One row of the process table: settings, and the passes and places where they apply."""

    layer: Annotated[int, Field(ge=1)] | tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] | None = Field(
        None, description="number of the layer, or [first, last]; 1 lies on the part's own metal; default: all"
    )
    kind: Literal["row", "ring", "spiral", "rim", "gap", "contour", "fill"] | None = Field(
        None, description="kind of pass; contour: ring and rim, fill: row, spiral and gap; default: all"
    )
    first: bool = Field(False, description="only the first pass of a layer")
    radius: Span | None = Field(
        None, description="{least, most}: where the pass bends with such a radius, over two bead widths; default: all"
    )
    thickness: Span | None = Field(
        None, description="{least, most}: where the finished metal is so wide, across the layer's normal; default: all"
    )
    rest: Span | None = Field(
        None,
        description="{least, most}: where so many seconds passed since the bead of another pass was laid beside or "
        "below; places without such a bead count as cold; default: all",
    )
    set: dict[Name, float] = Field(
        min_length=1, description="values by name, as power, powder, wire, gas; speed is the feed, in lengths a minute"
    )

    @property
    def is_general(self) -> bool:
        """Whether it holds for all passes."""
        return self == Setting(set=self.set)

    @property
    def is_local(self) -> bool:
        """Whether it may hold for a part of a pass only."""
        return not (self.radius is None and self.thickness is None and self.rest is None)


def check_table(table: tuple[Setting, ...]) -> tuple[Setting, ...]:
    """Refuses a table that leaves a channel without a value on some passes, or a speed that is not above 0."""
    general = {name for row in table if row.is_general for name in row.set}
    open_names = sorted({name for row in table for name in row.set} - general - {SPEED})
    if open_names:
        raise ValueError(f"{', '.join(open_names)}: has no value for all passes; begin with a row that only has set")
    if any(row.set.get(SPEED, 1.0) <= 0 for row in table):
        raise ValueError("speed: has to be above 0")
    if any(row.rest is not None and SPEED in row.set for row in table):
        raise ValueError("speed: may not depend on rest, which depends on the speed")
    return table


def list_channels(table: tuple[Setting, ...]) -> tuple[str, ...]:
    """The names of the channels that a table sets, in the order in which paths have them; not the speed."""
    return tuple(dict.fromkeys(name for row in table for name in row.set if name != SPEED))


ProcessTable = Annotated[tuple[Setting, ...], AfterValidator(check_table)]
