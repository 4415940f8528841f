"""The bounding box as background."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._shape import ShapeBackground


class BoundingBox(ShapeBackground):
    """The bounding box, larger by the clearance (paper 3.2): for prismatic parts."""

    use: Literal["bbox"] = "bbox"
    edge: float = Field(
        2.0, gt=0, le=100, description="longest edge, in tolerances; longer where that would make too many triangles"
    )

    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """The box."""
        from manifold3d import Manifold

        low = np.minimum(part.bounds[0], surface.bounds[0]) - gap
        high = np.maximum(part.bounds[1], surface.bounds[1]) + gap
        return Manifold.cube((high - low).tolist()).translate((low - origin).tolist())
