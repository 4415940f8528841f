"""Every rim."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Rims, Surface
from damageest.stages.boundary import Boundary


class AllLoops(Boundary):
    """Every loop of more than ten nodes: for walls worn through and grooves round a shaft."""

    use: Literal["all_loops"] = "all_loops"

    def run(self, surface: Surface) -> Rims:
        """Raises StageError where there is no loop of more than ten nodes."""
        from damageest.stages.boundary._loops import rims

        return Rims(tuple(rims(surface)))
