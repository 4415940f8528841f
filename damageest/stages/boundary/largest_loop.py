"""The longest rim only."""

from __future__ import annotations

from typing import Literal

from damageest.artefacts import Rims, Surface
from damageest.stages.boundary import Boundary


class LargestLoop(Boundary):
    """Only the boundary loop with the most nodes (paper 3.1 step 6 and 3.2). `enclose` closes the others flat."""

    use: Literal["largest_loop"] = "largest_loop"

    def run(self, surface: Surface) -> Rims:
        """Raises StageError where there is no loop of more than ten nodes."""
        from damageest.geometry.loops import trace_rims

        return Rims(tuple(trace_rims(surface)[:1]))
