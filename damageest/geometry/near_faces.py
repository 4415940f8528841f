"""Which skin comes nearest to conditions that select none, for messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.geometry.distance import closest_on_mesh

if TYPE_CHECKING:
    from damageest.geometry.selectors import Selector

NAMED = 3
"""How many CAD faces are named."""


def name_nearest_skin(selector: Selector, part: Part) -> str:
    """The CAD faces nearest to the selection, the nearest first; of a mesh, the nearest place."""
    short = measure_shortfall(selector, part)
    order = np.argsort(short, kind="stable")
    if part.faces_brep is None:
        place = _find_place(selector, part, int(order[0]))
        return "the nearest skin is at (" + ", ".join(f"{x:.4g}" for x in place) + ")"
    numbers = list(dict.fromkeys(part.faces_brep[order].tolist()))[:NAMED]
    names = [
        f"{number} ({part.face_names[number]})"
        if number < len(part.face_names) and part.face_names[number]
        else f"{number}"
        for number in numbers
    ]
    return f"the nearest CAD faces are {', '.join(names)}; damageest faces lists all"


def measure_shortfall(selector: Selector, part: Part) -> Floats:
    """(F,) distance of each triangle from the conditions: lengths in diagonals of the part, and turns in half turns."""
    corners, short = part.triangles, np.zeros(len(part.faces))
    if selector.box is not None:
        low, high = np.array(selector.box)
        beyond = np.maximum(np.maximum(low - corners.max(axis=1), corners.min(axis=1) - high), 0)
        short += (np.linalg.norm(beyond, axis=1) + 1e-3 * _measure_to(corners, (low + high) / 2)) / part.diagonal
    if selector.half_space is not None:
        normal = np.array(selector.half_space.normal) / np.linalg.norm(selector.half_space.normal)
        height = (corners - np.array(selector.half_space.point)) @ normal
        short += np.maximum(-height.max(axis=1), 0) / part.diagonal
    if selector.facing is not None:
        direction = np.array(selector.facing.direction) / np.linalg.norm(selector.facing.direction)
        turn = np.degrees(np.arccos(np.clip(part.face_normals @ direction, -1, 1)))
        short += np.maximum(turn - selector.facing.angle, 0) / 180
    return np.asarray(short)


def _measure_to(corners: Floats, place: Floats) -> Floats:
    """(F,) distance of a point from each of the triangles (F,3,3), by their nearest corner or middle."""
    places = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
    return np.asarray(np.linalg.norm(places - place, axis=2).min(axis=1))


def _find_place(selector: Selector, part: Part, face: int) -> Floats:
    """A place on the part that comes nearest."""
    if selector.box is None:
        return np.asarray(part.triangles[face].mean(axis=0))
    middle = np.mean(selector.box, axis=0)
    return np.asarray(closest_on_mesh(middle[None], part)[2][0])
