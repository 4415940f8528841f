"""Whether a scan shows two surfaces over the same skin: one on the skin, and one below it."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Deviation, Flags, Floats, Ints, Part, Scan
from damageest.geometry.neighbourhoods import find_in_box, find_neighbours

ON_SKIN, BELOW = 0.4, 0.9
"""Largest distance from the skin of points on it, and least depth of those below it, in tolerances."""
NEIGHBOURS = 12
"""Points looked at about each point of the site."""
LEAST, MOST = 0.25, 0.75
"""Share of them on the skin between which both kinds are there."""
BETWEEN = 0.25
"""Share of them between both, from which they are one surface with noise: wear of less than a tolerance."""
APART = 0.85
"""Distance of the middles of both kinds, in radii of the neighbours, from which they lie side by side, as at the rim of
a loss. Half discs lie 1.2 apart, twice six points drawn at random 0.58."""
FACING = 3.0
"""Weight of a difference of normals, in spacings: a thin wall has two sides."""
EVEN = 0.35
"""Spread of the depths of those below, as a share of their mean, up to which they are a surface. The points on a steep
wall lie at all depths below the same skin."""
MOST_ASKED = 2000
"""Points of the site that are asked; a share is right to two percent then."""


def measure_two_sheets(aligned: Scan, deviation: Deviation, part: Part, members: Ints, tolerance: float) -> float:
    """Share of a site's points ``members`` (M,) among whose neighbours along the skin are points on it.

    At the rim of a loss points of both kinds lie side by side. Where two views do not fit together, or one surface was
    scanned twice with an error between, they lie in the same place.
    """
    below = members[deviation.distance[members] < -BELOW * tolerance]
    if len(below) < NEIGHBOURS:
        return 0.0
    spacing = max(aligned.spacing, 1e-300)
    low, high = aligned.points[below].min(axis=0), aligned.points[below].max(axis=0)
    near = find_in_box(aligned.points, low - 3 * tolerance - 3 * spacing, high + 3 * tolerance + 3 * spacing)
    # whatever their label: among damaged points, means of neighbours make damage of points on the skin
    distance = deviation.distance[near]
    near, distance = near[distance < ON_SKIN * tolerance], distance[distance < ON_SKIN * tolerance]
    is_on = np.concatenate([np.zeros(len(below), bool), distance > -ON_SKIN * tolerance])
    is_between = np.concatenate([np.zeros(len(below), bool), (distance <= -ON_SKIN * tolerance)])
    is_between[len(below) :] &= distance > -BELOW * tolerance
    used = np.concatenate([np.ones(len(below), bool), is_on[len(below) :] | is_between[len(below) :]])
    feet = np.concatenate([_find_feet(aligned, deviation, part, index, FACING * spacing) for index in (below, near)])
    feet, is_on, is_between = feet[used], is_on[used], is_between[used]
    if is_on.sum() < NEIGHBOURS:
        return 0.0
    asked = np.arange(len(below))[:: max(1, len(below) // MOST_ASKED)]
    index = find_neighbours(feet[asked], NEIGHBOURS, feet)[1]
    offset, on, between = feet[index] - feet[asked][:, None], is_on[index], is_between[index]
    share = on.mean(axis=1)
    middle_on, middle_below = (_find_middle(offset, kind) for kind in (on, ~on & ~between))
    radius = np.sqrt(((offset - offset.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))
    apart = np.linalg.norm(middle_on - middle_below, axis=1) / np.maximum(radius, 1e-300)
    depth = -np.concatenate([deviation.distance[below], distance])[used][index]
    mean, spread = _measure_spread(depth, ~on & ~between)
    is_mixed = (share > LEAST) & (share < MOST) & (between.mean(axis=1) < BETWEEN) & (apart < APART)
    is_mixed &= spread < EVEN * mean
    return float(is_mixed.mean())


def _measure_spread(values: Floats, chosen: Flags) -> tuple[Floats, Floats]:
    """Mean and standard deviation (N,) of the chosen (N,M) of some values (N,M)."""
    count = np.maximum(chosen.sum(axis=1), 1)
    mean = (values * chosen).sum(axis=1) / count
    return mean, np.sqrt((((values - mean[:, None]) * chosen) ** 2).sum(axis=1) / count)


def _find_middle(offset: Floats, chosen: Flags) -> Floats:
    """(N,K) the middle of the chosen (N,M) of some offsets (N,M,K)."""
    return np.asarray((offset * chosen[..., None]).sum(axis=1) / np.maximum(chosen.sum(axis=1), 1)[:, None])


def _find_feet(aligned: Scan, deviation: Deviation, part: Part, index: Ints, weight: float) -> Floats:
    """(K,6) the places on the skin below points, and the weighted normals of the skin there."""
    normals = part.face_normals[deviation.face[index]]
    places = aligned.points[index] - deviation.distance[index, None] * normals
    return np.concatenate([places, weight * normals], axis=1)
