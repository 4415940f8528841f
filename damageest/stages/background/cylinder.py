"""A cylinder round part and damage surface."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._axis import Axis, count_segments, fit_axis, take_hull_points
from damageest.stages.background._generated import Generated


class CylinderBackground(Generated):
    """The cylinder round the part, somewhat larger (paper 3.2): for parts turned on a lathe."""

    use: Literal["cylinder"] = "cylinder"
    axis: Axis = Field(
        "auto", description="x, y, z, a vector, or auto: round which it is smallest; in the part's frame"
    )

    def build_shape(self, part: Part, surface: Surface, by: float, origin: Floats) -> Any:
        """The cylinder, as a prism whose flats keep the distance."""
        from manifold3d import Manifold

        points = take_hull_points(part.vertices, surface.vertices) - origin
        frame, centre, radius = fit_axis(points, self.axis)
        count = count_segments(radius + by, by)
        low, high = (frame[2] @ points.T).min() - by, (frame[2] @ points.T).max() + by
        wide = (radius + by) / float(np.cos(np.pi / count))
        body = Manifold.cylinder(float(high - low), wide, wide, count).translate((*centre, low))
        return body.transform(np.concatenate([frame.T, np.zeros((3, 1))], axis=1))
