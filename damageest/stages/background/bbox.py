"""A box round part and damage surface."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._generated import Generated


class BoundingBox(Generated):
    """The bounding box, somewhat larger (paper 3.2): for prismatic parts."""

    use: Literal["bbox"] = "bbox"
    edge: float = Field(
        2.0, gt=0, le=100, description="spacing of its vertices, in tolerances; more where that would make too many"
    )

    def build_shape(self, part: Part, surface: Surface, by: float, origin: Floats) -> Any:
        """The box."""
        from manifold3d import Manifold

        low = np.minimum(part.bounds[0], surface.bounds[0]) - by
        high = np.maximum(part.bounds[1], surface.bounds[1]) + by
        return Manifold.cube((high - low).tolist()).translate((low - origin).tolist())
