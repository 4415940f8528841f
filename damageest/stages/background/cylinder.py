"""A cylinder as background."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._axis import AxisOption, count_segments, fit_axis, take_hull_points
from damageest.stages.background._shape import ShapeBackground


class CylinderBackground(ShapeBackground):
    """The cylinder around the part, larger by the clearance (paper 3.2): for parts turned on a lathe."""

    use: Literal["cylinder"] = "cylinder"
    axis: AxisOption = Field(
        "auto", description="x, y, z or a vector, in the part's frame; auto: the axis of the smallest cylinder"
    )

    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """The cylinder, as a prism whose flat sides keep the clearance."""
        from manifold3d import Manifold

        points = take_hull_points(part.vertices, surface.vertices) - origin
        frame, centre, radius = fit_axis(points, self.axis)
        count = count_segments(radius + gap, gap)
        low, high = (frame[2] @ points.T).min() - gap, (frame[2] @ points.T).max() + gap
        wide = (radius + gap) / float(np.cos(np.pi / count))
        body = Manifold.cylinder(float(high - low), wide, wide, count).translate((*centre, low))
        return body.transform(np.concatenate([frame.T, np.zeros((3, 1))], axis=1))
