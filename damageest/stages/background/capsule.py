"""A capsule round part and damage surface."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.stages.background._axis import Axis, count_segments, fit_axis, take_hull_points
from damageest.stages.background._generated import Generated


class Capsule(Generated):
    """The cylinder with domed ends round the part (paper 3.2): for turned parts with rounded or tapered ends."""

    use: Literal["capsule"] = "capsule"
    axis: Axis = Field(
        "auto", description="x, y, z, a vector, or auto: round which it is smallest; in the part's frame"
    )

    def build_shape(self, part: Part, surface: Surface, by: float, origin: Floats) -> Any:
        """The hull of two balls, as far apart as the part's ends ask for."""
        from manifold3d import Manifold

        points = take_hull_points(part.vertices, surface.vertices) - origin
        frame, centre, radius = fit_axis(points, self.axis)
        local = points @ frame.T - [*centre, 0]
        # A dome holds the points that lie within its radius; where it has to begin, the outermost of them says.
        reach = np.sqrt(np.maximum((radius + 1e-3 * by) ** 2 - (local[:, :2] ** 2).sum(axis=1), 0))
        low, high = (local[:, 2] + reach).min(), (local[:, 2] - reach).max()
        low, high = min(low, high), max(low, high)
        count = count_segments(radius + by, by)
        ball = Manifold.sphere((radius + by) / float(np.cos(np.pi / count) ** 2), count)
        body = Manifold.batch_hull([ball.translate((*centre, low)), ball.translate((*centre, high))])
        return body.transform(np.concatenate([frame.T, np.zeros((3, 1))], axis=1))
