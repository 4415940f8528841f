"""CAD points spread evenly over the faces, and nowhere else on purpose (paper 3.1 step 1)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Samples
from damageest.errors import InputError
from damageest.stages.sample import Sample
from damageest.stages.sample._spread import spread_points, thin

FINE = 0.3
"""Step of the candidates, in units of the spacing: the surface is within it of one of them."""


class Uniform(Sample):
    """Points evenly over the faces alone, regardless of triangles and edges. Deterministic."""

    use: Literal["uniform"] = "uniform"
    spacing: float = Field(
        1.0, gt=0, description="largest distance from the surface to its nearest point, in tolerances"
    )
    max_points: int = Field(
        300_000, ge=1000, description="where the spacing would need more points than this, it is enlarged and says so"
    )

    def run(self, part: Part, tolerance: float) -> Samples:
        """Points (N,3) in the part's frame, each on its face's inside, no two closer than 0.7 of ``Samples.spacing``
        (but where that would leave a gap); every point of the surface is within ``Samples.spacing`` of one of them.

        The gap holds by construction: candidates lie within 0.3 of the spacing of any point of the surface, and a
        Poisson-disk-like choice from them leaves none farther than 0.7 from a chosen one. Triangles without area have
        no points. Raises InputError where the part has no area.
        """
        area = part.area
        if not area > 0:
            raise InputError("the part's surface has no area; check the file it was read from")
        spacing = max(self.spacing * tolerance, float(np.sqrt(1.3 * area / self.max_points)))
        triangles, cross = part.triangles, part.cross
        double_area = np.linalg.norm(cross, axis=1)
        longest = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
        sound = np.flatnonzero(double_area > 1e-12 * part.diagonal * longest)
        while True:
            candidates, of = spread_points(triangles, sound, FINE * spacing)
            kept = thin(candidates, (1 - FINE) * spacing, (1 - FINE) * spacing)
            excess = len(kept) / self.max_points
            if excess <= 1:
                break
            spacing *= 1.02 * np.sqrt(excess)
        face = of[kept]
        normals: Floats = cross[face] / double_area[face, None]
        return Samples(candidates[kept], normals, face, np.zeros(len(kept), np.uint8), spacing)
