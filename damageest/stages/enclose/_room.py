"""The room between part and background, divided by whether lost metal is nearer or what is left of the part."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Solid
from damageest.errors import StageError
from damageest.geometry.contour import extract_contour
from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import to_arrays, to_manifold

CELLS = 48
"""Cells of the grid along the longest edge of the background. The wall needs no accuracy: it never touches the part."""


def join_room(lost: Any, left: Any, background: Solid, part: Part) -> Mesh:
    """The lost metal with the room up to the ``background`` that is nearer to it than to what is left.

    ``lost`` and ``left``: Manifolds relative to the middle of the part's bounds. What the background does not hold of
    the lost metal is not in the result. Raises StageError where that is all of it.
    """
    origin = part.bounds.mean(axis=0)
    own, rest = (Mesh(*to_arrays(one, origin)) for one in (lost, left))
    low, high = background.bounds
    cell = float((high - low).max()) / CELLS
    nx, ny, nz = (int(n) for n in np.ceil((high - low) / cell) + 3)

    def measure(points: Floats) -> Floats:
        to_left = signed_distance(points, rest)[0]
        return np.asarray(np.maximum((signed_distance(points, own)[0] - to_left) / 2, 1.8 * cell - to_left))

    hold = to_manifold(background, origin)
    if not (lost ^ hold).volume() > 0:
        raise StageError("the background contains none of the lost metal", "background: minkowski", method="implicit")
    try:
        room = to_manifold(extract_contour(measure, low - cell, (nx, ny, nz), cell), origin)
    except StageError:  # narrower than the cells everywhere
        return Mesh(*to_arrays(lost ^ hold, origin))
    return Mesh(*to_arrays((lost + (room - left)) ^ hold, origin))
