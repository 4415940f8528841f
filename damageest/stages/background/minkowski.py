"""The Minkowski sum of part and ball as background."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from damageest.artefacts import Floats, Part, Surface
from damageest.geometry.solids import to_manifold
from damageest.stages.background._shape import MOST_FACES, ShapeBackground


class Minkowski(ShapeBackground):
    """The surface at the clearance from the part: the Minkowski sum of part and ball (paper 3.2). For any part.

    It follows the part and closes gaps narrower than twice the clearance. The part's triangulation does not matter.
    """

    use: Literal["minkowski"] = "minkowski"

    def build_shape(self, part: Part, surface: Surface, gap: float, origin: Floats) -> Any:
        """The level set of the distance to the part. Raises StageError where its grid would not fit into memory."""
        from damageest.geometry.contour import extract_contour
        from damageest.geometry.distance import signed_distance

        # A cell has about two triangles: the grid is as fine as the clearance, or as the number of triangles allows.
        cell = max(gap, float(np.sqrt(2.5 * part.area / MOST_FACES)))
        low = part.bounds[0] - gap - 3 * cell
        nx, ny, nz = (int(n) for n in np.ceil((part.bounds[1] + gap + 3 * cell - low) / cell).astype(int) + 1)

        def measure_gap(points: Floats) -> Floats:
            # Between grid nodes the level set is flat and cuts corners, so a coarse grid needs more distance.
            return signed_distance(points, part)[0] - max(gap, 0.6 * cell) - 0.1 * cell

        return to_manifold(extract_contour(measure_gap, low, (nx, ny, nz), cell), origin)
