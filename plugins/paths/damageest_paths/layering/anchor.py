"""Where the first layer of planes lies: on the floor of the deposit as a surface, not on its deepest spike."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.solids import to_arrays

PLACES, MOST = 6, 120
"""Places across a bead's width at which the floor is looked for, and at most across the deposit."""
LOWEST = 0.02
"""Share of the floor that may lie lower than the foot of the first layer."""
FARTHEST = 1.0
"""Heights of a layer that this foot may lie above the deepest place of the deposit."""


def find_foot(local: Any, width: float, height: float) -> float:
    """The height of the foot of the first layer of a deposit, a Manifold in local coordinates.

    The floor is what is seen from below, its median over a bead's ``width``. ``height``: of a layer.
    """
    from scipy import ndimage

    left, back, low, right, front, _ = local.bounding_box()
    step = max(width / PLACES, max(right - left, front - back) / MOST)
    x, y = np.arange(left + step / 2, right, step), np.arange(back + step / 2, front, step)
    if not len(x) or not len(y):
        return float(low)
    under = low - height
    start = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((len(x), len(y)), under)], axis=-1)
    up = np.tile([0.0, 0.0, 1.0], (start[..., 0].size, 1))
    way = RayCaster(Mesh(*to_arrays(local))).find_first(start.reshape(-1, 3), up)[0]
    floor = under + way.reshape(len(x), len(y))
    is_floor = np.isfinite(floor)
    if not is_floor.any():
        return float(low)
    # beside the deposit the floor goes on as high as at the nearest place of it
    nearest = ndimage.distance_transform_edt(~is_floor, return_distances=False, return_indices=True)
    reach = max(1, round(width / 2 / step))
    across = np.arange(-reach, reach + 1)
    disc = np.hypot(*np.meshgrid(across, across)) <= reach + 0.5
    smooth = ndimage.median_filter(floor[tuple(nearest)], footprint=disc, mode="nearest")
    return float(np.clip(np.quantile(smooth[is_floor], LOWEST), low, low + FARTHEST * height))
