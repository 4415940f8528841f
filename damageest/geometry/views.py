"""From where a place on a part is seen best.

Meshes, bounds and views are in one unit and one frame.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.geometry.rays import RayCaster
from damageest.geometry.vectors import normalise

DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
DIRECTIONS = normalise(DIRECTIONS)
OVERVIEWS = np.array([(x, y, 0.8) for x, y in ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))])
OVERVIEWS = normalise(OVERVIEWS)
"""Directions that all of a part is looked at from: askew and from above."""
PROBES = 150
"""Points of a damage surface for which it is tested from where they are seen."""


GRAZING = 0.1
"""Cosine of the angle between a normal and the way to the eye below which a place is not seen."""


class View(NamedTuple):
    """A place to look at: ``centre`` (3,), ``radius`` of the visible region, ``direction`` (3,) from there to the eye,
    and ``up`` (3,)."""

    centre: Floats
    radius: float
    direction: Floats
    up: Floats


def choose_view(left: RayCaster, surface: Mesh, bounds: Floats, scale: float, directions: Floats = DIRECTIONS) -> View:
    """The view that shows most of a damage ``surface`` past the remaining part ``left``, rather from above and askew.

    ``bounds`` (2,3) of the damage; ``scale``: a length of which a thousandth is small.
    ``directions`` (K,3): unit vectors to the eye, to choose from.
    """
    centre, radius = bounds.mean(axis=0), float(np.linalg.norm(np.ptp(bounds, axis=0)) / 2)
    slope = -directions @ np.array([1.0, 1.0, -1.0]) / np.sqrt(3)  # highest from the front, the left and above
    score = 0.1 * slope
    if len(surface.faces):
        every = max(len(surface.faces) // PROBES, 1)
        normals = surface.face_normals[::every]
        places = surface.triangles[::every].mean(axis=1) + 1e-3 * scale * normals
        starts = np.repeat(places, len(directions), axis=0)
        ways = np.tile(directions, (len(places), 1))
        free = np.isinf(left.find_first(starts, ways)[0]).reshape(len(places), -1)
        facing = np.clip(normals @ directions.T, 0, None)
        score = score + (free * (facing > GRAZING) * (0.4 + 0.6 * facing)).mean(axis=0)
    direction = directions[int(score.argmax())]
    up = np.array([0.0, 1.0, 0.0]) if abs(direction[2]) > 0.99 else np.array([0.0, 0.0, 1.0])
    return View(centre, max(radius, 1e-3 * scale), direction, up)
