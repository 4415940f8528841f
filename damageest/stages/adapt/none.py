"""No adapting: the part is as designed."""

from __future__ import annotations

from typing import ClassVar, Literal

from damageest.artefacts import AdaptedPart
from damageest.stages.adapt import Adapt


class NoAdapt(Adapt):
    """Takes the part as it was designed. For parts whose form is within the tolerance."""

    use: Literal["none"] = "none"
    deforms: ClassVar[bool] = False

    def run(self) -> AdaptedPart | None:
        """None: the part as designed."""
        return None
