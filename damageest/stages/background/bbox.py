"""A box round part and damage surface."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Part, Solid, Surface
from damageest.stages.background import Background


class BoundingBox(Background):
    """The bounding box, somewhat larger and subdivided (paper 3.2): for prismatic parts."""

    use: Literal["bbox"] = "bbox"
    clearance: float = Field(
        2.0, gt=0, le=100, description="space between part and box, in tolerances; at least 1.5 point spacings"
    )
    edge: float = Field(
        2.0, gt=0, le=100, description="spacing of its vertices, in tolerances; more where that would make too many"
    )

    def run(self, part: Part, surface: Surface, tolerance: float, spacing: float) -> Solid:
        """A box of at most some 400,000 triangles."""
        from manifold3d import Manifold

        from damageest.stages.background._refine import refined

        by = max(self.clearance * tolerance, 1.5 * spacing)
        low = np.minimum(part.bounds[0], surface.bounds[0]) - by
        high = np.maximum(part.bounds[1], surface.bounds[1]) + by
        return refined(Manifold.cube((high - low).tolist()), self.edge * max(tolerance, 0.5 * spacing), low)
