"""The middle line of a pass in the plane of a layer, and what it is."""

from __future__ import annotations

from typing import Literal, NamedTuple

from damageest.artefacts import Floats

Kind = Literal["row", "ring", "spiral", "rim", "gap"]
"""What a pass is: a row or rows to and fro, a ring, rings that are linked, a piece of the outermost ring beside
rows, or a row in a gap between others."""


class Line(NamedTuple):
    """The middle line of a pass (K,2), and what it is."""

    points: Floats
    kind: Kind
