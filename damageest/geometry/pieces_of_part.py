"""Whether a scan that is much smaller than the part shows a piece of it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.transforms import move_points
from damageest.geometry.units import MILLIMETRES

NEAR, NEAR_OWN = 0.005, 0.02
"""Distance from the skin, in diagonals of the part and of the scan, within which a point lies on it."""
SHARE = 0.6
"""Share of the points that lie so near, of a scan of a piece. Of one in another unit, fewer do."""
LEAST = 0.02
"""Size of the scan in diagonals of the part below which it tells nothing: all of it may be near one place."""
LOOKED_AT = 5000


def is_piece(points: Floats, part: Part, T: Floats) -> bool:
    """Whether points (N,3) lie on the skin of the part in the pose ``T`` (4,4), reach far enough to tell, and would lie
    there in no other unit."""
    some = points[:: max(1, len(points) // LOOKED_AT)]
    size = float(np.linalg.norm(part.bounds[1] - part.bounds[0]))
    reach = float(np.linalg.norm(np.ptp(some, axis=0))) if len(some) else 0.0
    if reach < LEAST * size:
        return False
    near = min(NEAR * size, NEAR_OWN * reach)

    def lies_there(factor: float) -> bool:
        return bool((distance_to_mesh(move_points(factor * some, T), part) < near).mean() >= SHARE)

    factors = {one / MILLIMETRES[part.unit] for one in MILLIMETRES.values()} - {1.0}
    return lies_there(1.0) and not any(lies_there(factor) for factor in sorted(factors) if factor > 1)
