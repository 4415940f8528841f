"""What the process is given besides its place: power, powder or wire, gas and speed, by layer and kind of pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field, StringConstraints

from damageest.artefacts import DepositPath
from damageest.options import Options

SPEED = "speed"
"""The channel that is the feed itself, in lengths a minute."""
KINDS = {"contour": ("ring", "rim"), "fill": ("row", "spiral", "gap")}
"""Names for several kinds of passes."""
Name = Annotated[str, StringConstraints(pattern="^[a-z][a-z0-9_]*$")]


class Setting(Options):
    """One row of the table of the process: what is set, and on which passes."""

    layer: Annotated[int, Field(ge=1)] | tuple[Annotated[int, Field(ge=1)], Annotated[int, Field(ge=1)]] | None = Field(
        None, description="number of the layer, or [first, last]; 1 lies on the part's own metal; default: all"
    )
    kind: Literal["row", "ring", "spiral", "rim", "gap", "contour", "fill"] | None = Field(
        None, description="of the pass; contour: ring and rim, fill: row, spiral and gap; default: all"
    )
    first: bool = Field(False, description="only the first pass of a layer")
    set: dict[Name, float] = Field(
        min_length=1, description="values by name, as power, powder, wire, gas; speed is the feed, in lengths a minute"
    )

    @property
    def is_general(self) -> bool:
        """Whether it holds for all passes."""
        return self.layer is None and self.kind is None and not self.first


def check_table(table: tuple[Setting, ...]) -> tuple[Setting, ...]:
    """Refuses a table that leaves a channel without a value on some passes, or a speed that is not above 0."""
    general = {name for row in table if row.is_general for name in row.set}
    open_names = sorted({name for row in table for name in row.set} - general - {SPEED})
    if open_names:
        raise ValueError(
            f"{', '.join(open_names)}: has no value for all passes; begin with a row without layer, kind and first"
        )
    if any(row.set.get(SPEED, 1.0) <= 0 for row in table):
        raise ValueError("speed: has to be above 0")
    return table


ProcessTable = Annotated[tuple[Setting, ...], AfterValidator(check_table)]


def apply_table(path: DepositPath, table: Sequence[Setting]) -> DepositPath:
    """The path with its channels, in the order in which the table names them, and with the speeds of the table. Of rows
    that hold for a pass, the last counts. Travel keeps its speed, and has the values of the pass that it leads to."""
    names = list(dict.fromkeys(name for row in table for name in row.set if name != SPEED))
    if not table or not len(path.points):
        return path
    feed = path.feed.copy()
    values = np.zeros((len(feed), len(names)))
    kinds = np.array(path.kinds or ("row",) * path.passes)[path.number - 1]
    places = np.stack([path.part, path.layer], axis=1)
    firsts = {tuple(place): int(number) for place, number in zip(places[::-1], path.number[::-1], strict=True)}
    is_first = np.array([firsts[tuple(place)] for place in places]) == path.number
    for row in table:
        low, high = row.layer if isinstance(row.layer, tuple) else (row.layer or 1, row.layer or path.layer.max())
        own = (path.layer >= low) & (path.layer <= high)
        if row.kind is not None:
            own &= np.isin(kinds, KINDS.get(row.kind, (row.kind,)))
        if row.first:
            own &= is_first
        for name, value in row.set.items():
            if name == SPEED:
                feed[own & path.on] = value
            else:
                values[own, names.index(name)] = value
    return replace(path, feed=feed, channels=tuple(names), values=values if names else None)
