"""Samples spread evenly over the faces, with none on purpose on edges (paper 3.1 step 1)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Samples
from damageest.errors import InputError
from damageest.geometry.spreading import spread_points, thin
from damageest.geometry.vectors import measure_longest_edges
from damageest.stages.sample import Sample

FINE = 0.3
"""Step of the first points, in spacings: each place of the surface is within it of one of them."""


class Uniform(Sample):
    """Points spread evenly over the faces, independent of triangles and edges; no random draws."""

    use: Literal["uniform"] = "uniform"
    spacing: float = Field(
        1.0, gt=0, description="largest distance from any place of the surface to the nearest point, in tolerances"
    )
    max_points: int = Field(
        300_000,
        ge=1000,
        description="largest number of points; where the spacing would need more, the spacing is enlarged",
    )

    def run(self, part: Part, tolerance: float) -> Samples:
        """Points (N,3) in the part's frame, each inside its face; each place of the surface is within
        ``Samples.spacing`` of one of them, and two are rarely closer than 0.7 spacings.

        The first points lie within 0.3 spacings of each place of the surface. Of these a set like a Poisson-disk sample
        is chosen, and all are within 0.7 spacings of a chosen one. Triangles without area have no points. Raises
        InputError where the part has no area.
        """
        area = part.area
        if not area > 0:
            raise InputError("the part's surface has no area; check the file it was read from")
        spacing = max(self.spacing * tolerance, float(np.sqrt(1.3 * area / self.max_points)))
        triangles, cross = part.triangles, part.cross
        double_area = np.linalg.norm(cross, axis=1)
        longest = measure_longest_edges(triangles)
        usable = np.flatnonzero(double_area > 1e-12 * part.diagonal * longest)
        while True:
            candidates, of = spread_points(triangles, usable, FINE * spacing)
            kept = thin(candidates, (1 - FINE) * spacing, (1 - FINE) * spacing)
            excess = len(kept) / self.max_points
            if excess <= 1:
                break
            spacing *= 1.02 * np.sqrt(excess)
        face = of[kept]
        normals: Floats = cross[face] / double_area[face, None]
        return Samples(candidates[kept], normals, face, np.zeros(len(kept), np.uint8), spacing)
