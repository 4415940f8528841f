"""Which points of a scan can be compared with an earlier scan that stands for the part."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.neighbourhoods import find_neighbours, thin_points

STEP = 2.0
"""Edge of the cubes in which deep points are joined, in spacings of the scan."""
JOINED = 2.0
"""Distance up to which their means belong to one surface, in edges."""
AROUND = 8
"""Points on the skin that are looked at about the place above a deep one."""
WITHIN, EVEN = 4.0, 0.45
"""Distance from that place up to which they have to lie, in spacings, and of their middle, in radii of them: a place
inside a loss has no points on the skin near it, and one at its rim has them on one side."""
BESIDE = 1.5
"""How much farther than the skin that was seen may skin be that was not, for a deep point to be of either."""
MOST = 0.6
"""Share of a deep surface that lies under skin which is still there, or may be of skin that was not seen, from which it
is another surface of the part."""


def find_unshared(scan: Floats, spacing: float, part: Part, tolerance: float) -> tuple[Flags, Flags]:
    """Which points (N,3) face skin that the earlier scan did not see, and which others (N,) lie on surfaces below skin
    that is still there, as the far side of a wall of which the earlier scan saw the near one.

    ``spacing``: of the points. No loss leaves a surface under skin that is intact all around it.
    """
    assert part.unseen is not None
    distance, face, foot = closest_on_mesh(scan, part)
    unseen = np.asarray(part.unseen[face])
    below = np.einsum("ij,ij->i", scan - foot, part.face_normals[face]) < 0
    behind = np.zeros(len(scan), bool)
    deep = np.flatnonzero(~unseen & below & (distance > tolerance))
    skin = np.flatnonzero(~unseen & (distance <= tolerance))
    if not len(deep) or len(skin) < AROUND:
        return unseen, behind
    bare = Mesh(part.vertices, part.faces[part.unseen])
    is_beside = distance_to_mesh(scan[deep], bare) < BESIDE * distance[deep] if len(bare.faces) else np.zeros(1, bool)
    gap, index = find_neighbours(foot[deep], AROUND, scan[skin])
    middle = np.linalg.norm(scan[skin][index].mean(axis=1) - foot[deep], axis=1)
    is_covered = (gap[:, -1] < WITHIN * spacing) & (middle < EVEN * gap[:, -1])
    surface = _join(scan[deep], STEP * spacing)
    share = np.bincount(surface, is_covered | is_beside) / np.bincount(surface)
    behind[deep[share[surface] > MOST]] = True
    return unseen, behind


def _join(points: Floats, edge: float) -> Ints:
    """The number (N,) of the surface that each of the points (N,3) belongs to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    means = thin_points(points, edge)[0]
    pairs = cKDTree(means).query_pairs(JOINED * edge, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(means), len(means)))
    label = np.asarray(connected_components(links, directed=False)[1])
    return np.asarray(label[find_neighbours(points, 1, means)[1][:, 0]])
