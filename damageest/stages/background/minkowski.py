"""The Minkowski sum of part and ball."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from damageest.artefacts import Floats, Part, Surface
from damageest.geometry.solids import to_manifold
from damageest.stages.background._generated import MOST_FACES, Generated


class Minkowski(Generated):
    """The part swept by a ball of the clearance's radius (paper 3.2), as the surface at that distance from it: follows
    any part, closes gaps narrower than twice the clearance, and takes no notice of how the part is triangulated."""

    use: Literal["minkowski"] = "minkowski"

    def build_shape(self, part: Part, surface: Surface, by: float, origin: Floats) -> Any:
        """The level of the distance. Raises StageError where its lattice would not fit in memory."""
        from damageest.geometry.contour import extract_contour
        from damageest.geometry.distance import signed_distance

        # Two triangles to a cell: a lattice as fine as the clearance, or as the number of triangles allows.
        cell = max(by, float(np.sqrt(2.5 * part.area / MOST_FACES)))
        low = part.bounds[0] - by - 3 * cell
        nx, ny, nz = (int(n) for n in np.ceil((part.bounds[1] + by + 3 * cell - low) / cell).astype(int) + 1)

        def outside(points: Floats) -> Floats:
            # Between nodes the level runs straight and cuts corners, which a coarse lattice has to be farther off for.
            return signed_distance(points, part)[0] - max(by, 0.6 * cell) - 0.1 * cell

        return to_manifold(extract_contour(outside, low, (nx, ny, nz), cell), origin)
