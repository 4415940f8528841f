"""Every rim."""

from __future__ import annotations

from typing import Literal

import numpy as np

from damageest.artefacts import Part, Rims, Surface
from damageest.stages.boundary import Boundary

DEEP = 5.0
"""Tolerances below the skin: the damage surface begins at one, and at two where the scan is thin at its rim."""


class AllLoops(Boundary):
    """Every loop of more than ten nodes that comes near the part's skin: for walls worn through and grooves round a
    shaft. Loops deep inside are gaps of the scan, and closed."""

    use: Literal["all_loops"] = "all_loops"

    def run(self, surface: Surface, part: Part, tolerance: float) -> Rims:
        """Raises StageError where there is no such loop."""
        from damageest.geometry.distance import signed_distance
        from damageest.geometry.loops import trace_rims

        found = trace_rims(surface)
        depth = [-signed_distance(surface.vertices[loop], part)[0] for loop in found]
        near = [loop for loop, one in zip(found, depth, strict=True) if np.quantile(one, 0.25) < DEEP * tolerance]
        return Rims(tuple(near or found[:1]))
