"""Which points of a scan can be compared with an earlier scan that stands for the part."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.neighbourhoods import find_neighbours, thin_points
from damageest.geometry.point_pieces import number_pieces

STEP = 2.0
"""Edge of the cubes in which deep points are joined, in spacings of the scan."""
JOINED = 2.0
"""Distance up to which their means belong to one surface, in edges."""
AROUND = 16
"""Points on the skin that are looked at about the place above a deep one."""
WITHIN, EVEN = 2.8, 0.28
"""Distance from that place up to which they have to lie, in spacings, and of their middle, in radii of them, for the
skin there to be intact. On intact skin sixteen points lie within 2.1 spacings. At the rim of a loss they lie on one
side, and their middle is 0.42 radii away; all around a place it is 0.16, and once in ten more than 0.28."""
FACING = 2.0
"""Weight of a difference of normals, in spacings: skin round an edge does not cover a place."""
RIM = 2.0
"""Distance from skin that was not seen, in spacings, up to which a place is at the edge of what was."""
TOUCH, TOUCHING = 2.5, 3
"""Distance from points on the skin, in spacings, within which a deep surface meets it, and points of it that have to:
what a loss left behind ends at skin that is still there."""
LEAST = 0.15
"""Share of a deep surface that has to lie below skin which is gone, for it to be what a loss left behind."""


def find_unshared(scan: Floats, spacing: float, part: Part, tolerance: float) -> tuple[Flags, Flags]:
    """Which points (N,3) face skin that the earlier scan did not see, and which others (N,) lie deep, on surfaces that
    no loss made.

    ``spacing``: of the points. A loss takes skin away: below it, there are places where the earlier scan saw skin and
    this one sees none. A surface without such places is another one of the part: the far side of a wall of which the
    earlier scan saw the near one, or a side that begins where the earlier scan ended. So is one that nowhere meets skin
    which is still there.
    """
    assert part.unseen is not None
    distance, face, foot = closest_on_mesh(scan, part)
    unseen = np.asarray(part.unseen[face])
    normals = part.face_normals[face]
    below = np.einsum("ij,ij->i", scan - foot, normals) < 0
    other = np.zeros(len(scan), bool)
    deep = np.flatnonzero(~unseen & below & (distance > tolerance))
    skin = np.flatnonzero(~unseen & (distance <= tolerance))
    if not len(deep) or len(skin) < AROUND:
        return unseen, other
    weight = FACING * spacing * normals
    gap, index = find_neighbours(np.hstack([foot[deep], weight[deep]]), AROUND, np.hstack([foot[skin], weight[skin]]))
    middle = np.linalg.norm(foot[skin][index].mean(axis=1) - foot[deep], axis=1)
    is_gone = (gap[:, -1] > WITHIN * spacing) | (middle > EVEN * gap[:, -1])
    bare = Mesh(part.vertices, part.faces[part.unseen])
    if len(bare.faces):
        is_gone &= distance_to_mesh(foot[deep], bare) > RIM * spacing
    surface = _join(scan[deep], STEP * spacing)
    touches = find_neighbours(scan[deep], 1, scan[skin])[0][:, 0] < TOUCH * spacing
    is_loss = np.bincount(surface, is_gone) >= LEAST * np.bincount(surface)
    is_loss &= np.bincount(surface, touches) >= TOUCHING
    other[deep[~is_loss[surface]]] = True
    return unseen, other


def _join(points: Floats, edge: float) -> Ints:
    """The number (N,) of the surface that each of the points (N,3) belongs to."""
    means = thin_points(points, edge)[0]
    return np.asarray(number_pieces(means, JOINED * edge)[find_neighbours(points, 1, means)[1][:, 0]])
