"""All rims near the skin."""

from __future__ import annotations

from typing import Literal

import numpy as np

from damageest.artefacts import Part, Rims, Surface
from damageest.stages.boundary import Boundary

DEEPEST = 5.0
"""Deepest rim, in tolerances below the skin. Usual are one, and two where the scan has few points at the rim."""


class AllLoops(Boundary):
    """All boundary loops near the part's skin: also for walls worn through and grooves around a shaft.

    Loops of ten nodes or fewer and loops deep below the skin are gaps of the scan: `enclose` closes them.
    """

    use: Literal["all_loops"] = "all_loops"

    def run(self, surface: Surface, part: Part, tolerance: float) -> Rims:
        """Raises StageError where there is no loop of more than ten nodes."""
        from damageest.geometry.distance import signed_distance
        from damageest.geometry.loops import trace_rims

        loops = trace_rims(surface)
        depths = [-signed_distance(surface.vertices[loop], part)[0] for loop in loops]
        near = [
            loop for loop, depth in zip(loops, depths, strict=True) if np.quantile(depth, 0.25) < DEEPEST * tolerance
        ]
        return Rims(tuple(near or loops[:1]))
