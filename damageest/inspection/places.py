"""The finished skin of a repaired site, cut into places, and what the scan shows at each of them.

A place is no larger than the least defect that matters. Every scan point is judged at the place below or above it,
whatever else is out of tolerance there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Solid
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh, signed_distance
from damageest.geometry.neighbourhoods import find_neighbours, pick_one_per_cube
from damageest.geometry.sampling import sample_by_area

SAMPLES = 36
"""Samples of the skin for each square as wide as the least defect."""
FEWEST, MOST = 400, 150_000
"""Samples of a site's skin."""
PLACE = 0.7
"""Area of a place, in squares as wide as the least defect."""
ROUNDS = 4
"""Rounds that make the places alike in area."""
TURNED = 0.25
"""Weight of a difference of normals, in widths of the least defect: skin that faces the other way is beyond reach."""


class Skin(NamedTuple):
    """Samples of skin, evenly by area: ``at`` (S,3), outward unit ``normals`` (S,3), the ``area`` of each."""

    at: Floats
    normals: Floats
    area: float


@dataclass(frozen=True, eq=False)
class Places:
    """The finished skin of a site: its ``skin``, and the place ``of`` (S,) each sample, ``count`` of them. ``defect``:
    width of the least defect that matters."""

    skin: Skin
    of: Ints
    count: int
    defect: float

    def embed(self, at: Floats, normals: Floats) -> Floats:
        """(N,6) positions and weighted normals, in which near means near on one side of the metal."""
        return np.concatenate([at, TURNED * self.defect * normals], axis=1)


@dataclass(frozen=True, eq=False)
class Landed:
    """Scan points that lie over or under the skin of a site: their numbers ``index`` (N,) in the scan, ``feet`` (N,6)
    on the skin as `Places.embed` gives them, ``place`` (N,), and signed ``distance`` (N,) from the skin."""

    index: Ints
    feet: Floats
    place: Ints
    distance: Floats


def cut_places(target: Mesh, body: Solid, near: float, defect: float) -> Places | None:
    """The places of the skin of ``target`` that lies in a ``body`` or within ``near`` of it; None where there is none.

    ``body``: the deposit of a site. ``defect``: width of the least defect that matters. One unit, one frame.
    """
    skin = _sample_skin(target, body, near, defect)
    if skin is None:
        return None
    places = Places(skin, np.zeros(len(skin.at), np.int64), 1, defect)
    at = places.embed(skin.at, skin.normals)
    middle = at[pick_one_per_cube(skin.at, np.sqrt(PLACE) * defect)]
    of = places.of
    for _ in range(ROUNDS):
        of = find_neighbours(at, 1, middle)[1][:, 0]
        used, of = np.unique(of, return_inverse=True)
        sums = np.stack([np.bincount(of, at[:, k]) for k in range(6)], axis=1)
        middle = sums / np.bincount(of, minlength=len(used))[:, None]
    return Places(skin, of, len(middle), defect)


def land_points(places: Places, target: Mesh, points: Floats, distance: Floats) -> Landed:
    """The points (N,3) whose nearest skin of ``target`` belongs to the site. ``distance`` (N,): signed, to it."""
    low, high = places.skin.at.min(axis=0), places.skin.at.max(axis=0)
    beyond = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
    index = np.flatnonzero(beyond <= np.abs(distance) + places.defect)
    _, face, foot = closest_on_mesh(points[index], target)
    feet = places.embed(foot, target.face_normals[face])
    skin = places.embed(places.skin.at, places.skin.normals)
    reach = 2 * np.sqrt(places.skin.area)
    gap, nearest = find_neighbours(feet, 1, skin, reach)
    own = np.isfinite(gap[:, 0])
    return Landed(index[own], feet[own], places.of[nearest[own, 0]], distance[index[own]])


def _sample_skin(target: Mesh, body: Solid, near: float, defect: float) -> Skin | None:
    """Samples of the skin at a body."""
    low, high = body.bounds[0] - near, body.bounds[1] + near
    corners, face = _crop(target, low, high, max(defect, float(np.linalg.norm(high - low)) / 10))
    if not len(face):
        return None
    mesh = Mesh(corners.reshape(-1, 3), np.arange(3 * len(face)).reshape(-1, 3))
    whole = mesh.area
    if not whole > 0:
        return None
    count = int(np.clip(SAMPLES * whole / defect**2, FEWEST, MOST))
    at, piece = sample_by_area(mesh, count, np.random.default_rng(0))
    own = (distance_to_mesh(at, body) <= near) | (signed_distance(at, body)[0] < 0)
    if not own.any():
        return None
    return Skin(at[own], target.face_normals[face[piece[own]]], whole / count)


def _crop(mesh: Mesh, low: Floats, high: Floats, edge: float) -> tuple[Floats, Ints]:
    """Triangles (T,3,3) that cover the skin within a box, cut until no edge is longer than ``edge``, and the triangle
    (T,) of the mesh that each is a piece of."""
    face = np.arange(len(mesh.faces))
    corners, done = mesh.triangles, []
    while len(face):
        inside = (corners.max(axis=1) >= low).all(axis=1) & (corners.min(axis=1) <= high).all(axis=1)
        corners, face = corners[inside], face[inside]
        sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
        short = sides.max(axis=1, initial=0.0) <= edge
        done.append((corners[short], face[short]))
        corners, face, sides = corners[~short], face[~short], sides[~short]
        if not len(face):
            break
        first = sides.argmax(axis=1)
        rows = np.arange(len(face))
        a, b, c = (corners[rows, (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        face = np.concatenate([face, face])
    if not done:
        return np.empty((0, 3, 3)), np.empty(0, np.int64)
    return np.concatenate([one[0] for one in done]), np.concatenate([one[1] for one in done])
