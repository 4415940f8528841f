"""What fields are fitted to: the part's skin and metal, and the points near it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Mesh, Part
from damageest.geometry.distance import is_inside, signed_distance
from damageest.geometry.neighbourhoods import pick_one_per_cube
from damageest.geometry.refinement import cut_into_cells
from damageest.stages.adapt._basis import Basis
from damageest.stages.adapt._field import Body

FINE = 25.0
"""Edges along the part's diagonal of the triangles that points are matched with."""
PLACES = 500
"""Places in the metal where the strain is asked for."""


def prepare(part: Part, centre: Floats, tolerance: float, noise: float) -> Body:
    """What a polynomial field is fitted to the part by, about the centre."""
    extent = np.ptp(part.bounds, axis=0)
    size = float(extent.max()) / 2
    fine, _ = cut_into_cells(Mesh(part.vertices - centre, part.faces), part.diagonal / FINE)
    box = (spread_evenly(40 * PLACES) - 0.5) * extent
    inside = box[is_inside(box, fine)]
    inside = inside[:: max(1, len(inside) // PLACES)]
    inside = inside if len(inside) > PLACES // 10 else fine.triangles.mean(axis=1)[:: max(1, len(fine.faces) // PLACES)]
    return Body(fine, inside, tolerance / 4, noise, Basis(np.zeros(3), size, extent / 2 / size))


def spread_evenly(count: int) -> Floats:
    """(N,3) places in the unit cube whose means, over any box in it, are those of the box: an additive recurrence by
    the root of x^4 = x + 1."""
    root = 1.2207440846057596
    return np.asarray((0.5 + np.arange(1, count + 1)[:, None] * root ** -np.arange(1.0, 4.0)) % 1)


def thin(points: Floats, part: Part, count: int, reach: float) -> Floats:
    """About ``count`` of the points (N,3) that lie within ``reach`` of the part's skin, evenly spread."""
    kept = points[pick_one_per_cube(points, float(np.sqrt(part.area / count)))]
    return kept[np.abs(signed_distance(kept, part)[0]) < reach]
