"""A capsule as background."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._axis import AxisOption, count_segments, fit_axis, take_hull_points
from damageest.stages.background._shape import ShapeBackground


class Capsule(ShapeBackground):
    """The cylinder with domed ends around the part (paper 3.2): for turned parts with rounded or tapered ends."""

    use: Literal["capsule"] = "capsule"
    axis: AxisOption = Field(
        "auto", description="x, y, z or a vector, in the part's frame; auto: the axis of the smallest capsule"
    )

    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """The convex hull of two balls, as far apart as the part needs."""
        from manifold3d import Manifold

        points = take_hull_points(part.vertices, surface.vertices) - origin
        frame, centre, radius = fit_axis(points, self.axis)
        local = points @ frame.T - [*centre, 0]
        # Each dome begins where the points nearest to its end just fit in.
        reach = np.sqrt(np.maximum((radius + 1e-3 * gap) ** 2 - (local[:, :2] ** 2).sum(axis=1), 0))
        low, high = (local[:, 2] + reach).min(), (local[:, 2] - reach).max()
        low, high = min(low, high), max(low, high)
        count = count_segments(radius + gap, gap)
        ball = Manifold.sphere((radius + gap) / float(np.cos(np.pi / count) ** 2), count)
        body = Manifold.batch_hull([ball.translate((*centre, low)), ball.translate((*centre, high))])
        return body.transform(np.concatenate([frame.T, np.zeros((3, 1))], axis=1))
