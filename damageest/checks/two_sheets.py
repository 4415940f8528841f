"""Whether a scan shows two surfaces over the same skin: one on the skin, and one below it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import INTACT, Deviation, Floats, Ints, Part, Scan
from damageest.geometry.neighbourhoods import find_in_box, find_neighbours

ON_SKIN, BELOW = 0.4, 0.9
"""Largest distance from the skin of points on it, and least depth of those below it, in tolerances."""
NEIGHBOURS = 12
"""Points looked at about each point of the site."""
LEAST, MOST = 0.25, 0.75
"""Share of them on the skin between which both kinds are there."""
APART = 0.85
"""Distance of the middles of both kinds, in radii of the neighbours, from which they lie side by side, as at the rim of
a loss. Half discs lie 1.2 apart, twice six points drawn at random 0.58."""
FACING = 3.0
"""Weight of a difference of normals, in spacings: a thin wall has two sides."""
MOST_ASKED = 2000
"""Points of the site that are asked; a share is right to two percent then."""


def measure_two_sheets(aligned: Scan, deviation: Deviation, part: Part, members: Ints, tolerance: float) -> float:
    """Share of a site's points ``members`` (M,) among whose neighbours along the skin intact points are mixed in.

    At the rim of a loss points of both kinds lie side by side. Where two views do not fit together, or one surface was
    scanned twice with an error between, they lie in the same place.
    """
    below = members[deviation.distance[members] < -BELOW * tolerance]
    if len(below) < NEIGHBOURS:
        return 0.0
    spacing = max(aligned.spacing, 1e-300)
    low, high = aligned.points[below].min(axis=0), aligned.points[below].max(axis=0)
    near = find_in_box(aligned.points, low - 3 * tolerance - 3 * spacing, high + 3 * tolerance + 3 * spacing)
    on_skin = near[(deviation.label[near] == INTACT) & (np.abs(deviation.distance[near]) < ON_SKIN * tolerance)]
    if len(on_skin) < NEIGHBOURS:
        return 0.0
    feet_below, feet_on = (_find_feet(aligned, deviation, part, index, FACING * spacing) for index in (below, on_skin))
    feet = np.concatenate([feet_below, feet_on])
    is_on = np.arange(len(feet)) >= len(below)
    asked = np.arange(len(below))[:: max(1, len(below) // MOST_ASKED)]
    index = find_neighbours(feet[asked], NEIGHBOURS, feet)[1]
    offset, on = feet[index] - feet[asked][:, None], is_on[index]
    share = on.mean(axis=1)
    count_on = np.maximum(on.sum(axis=1), 1)[:, None]
    count_below = np.maximum((~on).sum(axis=1), 1)[:, None]
    middle_on = (offset * on[..., None]).sum(axis=1) / count_on
    middle_below = (offset * ~on[..., None]).sum(axis=1) / count_below
    radius = np.sqrt(((offset - offset.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))
    apart = np.linalg.norm(middle_on - middle_below, axis=1) / np.maximum(radius, 1e-300)
    return float(((share > LEAST) & (share < MOST) & (apart < APART)).mean())


def _find_feet(aligned: Scan, deviation: Deviation, part: Part, index: Ints, weight: float) -> Floats:
    """(K,6) the places on the skin below points, and the weighted normals of the skin there."""
    normals = part.face_normals[deviation.face[index]]
    places = aligned.points[index] - deviation.distance[index, None] * normals
    return np.concatenate([places, weight * normals], axis=1)
