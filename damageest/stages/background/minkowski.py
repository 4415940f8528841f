"""The Minkowski sum of part and ball as background."""

from __future__ import annotations

from typing import Any, Literal

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._level_set import build_level_set
from damageest.stages.background._shape import ShapeBackground


class Minkowski(ShapeBackground):
    """The surface at the clearance from the part: the Minkowski sum of part and ball (paper 3.2). For any part.

    It follows the part and closes gaps narrower than twice the clearance. The part's triangulation does not matter.
    """

    use: Literal["minkowski"] = "minkowski"

    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """The level set of the distance to the part. Raises StageError where its grid would not fit into memory."""
        return build_level_set(part, gap, origin)
