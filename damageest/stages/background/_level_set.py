"""The surface at a distance from a part, as a level set: it suits any part."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.geometry.solids import to_manifold
from damageest.stages.background._shape import MOST_FACES


def build_level_set(part: Part, gap: float, origin: Floats) -> Any:
    """A Manifold relative to ``origin`` (3,), at least ``gap`` from the part. Raises StageError where its grid would
    not fit into memory."""
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
