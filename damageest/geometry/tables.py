"""The plane on which a part stood when it was scanned."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.vectors import cross_corners

TRIALS = 400
"""Planes through three points that are tried."""
LOOKED_AT = 8000
LEAST = 0.15
"""Share of the points that a table has at least."""
ABOVE = 0.97
"""Share of the other points that lie on one side of it."""
AROUND = 0.4
"""Share of the table's points that lie outside the outline of what stands on it: a face of the part has none there."""


class Table(NamedTuple):
    """A plane by its unit ``normal`` (3,), towards the objects on it, and its ``offset`` along that."""

    normal: Floats
    offset: float

    def find(self, points: Floats, near: float) -> Flags:
        """Which points (N,3) lie within ``near`` of the plane, or below it."""
        return np.asarray(points @ self.normal - self.offset <= near)


def find_table(points: Floats, near: float) -> Table | None:
    """The plane that other points (N,3) stand on, and that reaches beyond them; None where there is none. ``near``:
    distance within which a point lies on it."""
    from scipy.spatial import ConvexHull, Delaunay, QhullError

    rng = np.random.default_rng(0)
    some = points[rng.permutation(len(points))[:LOOKED_AT]]
    if len(some) < 100:
        return None
    corners = some[rng.integers(0, len(some), (TRIALS, 3))]
    normals = cross_corners(corners)
    size = np.linalg.norm(normals, axis=1)
    normals, corners = normals[size > 0] / size[size > 0, None], corners[size > 0]
    heights = some @ normals.T - np.einsum("ij,ij->i", normals, corners[:, 0])
    best = int((np.abs(heights) <= near).sum(axis=0).argmax())
    on = np.abs(heights[:, best]) <= near
    for _ in range(3):
        middle = some[on].mean(axis=0)
        normal = np.linalg.svd(some[on] - middle, full_matrices=False)[2][2]
        height = (some - middle) @ normal
        on = np.abs(height) <= near
    off = some[np.abs(height) > 2 * near]
    if on.mean() < LEAST or len(off) < 50:
        return None
    side = np.sign(np.median((off - middle) @ normal)) or 1.0
    normal = normal * side
    if float(((off - middle) @ normal > 0).mean()) < ABOVE:
        return None
    plane = np.linalg.svd(normal[None])[2][1:]
    try:
        outline = off @ plane.T
        outline = outline[ConvexHull(outline).vertices]
        outside = Delaunay(outline).find_simplex(some[on] @ plane.T) < 0
    except QhullError:
        return None
    if float(outside.mean()) < AROUND:
        return None
    return Table(normal, float(middle @ normal))
