"""What lies under the beads of a path: air between a bead's foot and metal, and beads that are higher to reach it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from damageest.artefacts import DepositPath, Floats, Ints, Mesh, Solid
from damageest.geometry.rays import prepare_rays
from damageest.geometry.vectors import normalise
from damageest_paths.process.places import cut_moves, find_middles

LEAST, MOST = 0.1, 0.6
"""Shares of a layer's height: air from which a bead is made higher, and by how much at most."""
FINE = 0.1
"""The same: heights differ by steps of this."""
LONGEST = 0.75
"""Bead widths that a move is long at most: beads lie on beads of which a place is near."""
ACROSS = (-0.25, 0.0, 0.25)
"""Bead widths beside the middle of a bead at which the metal below is looked for; the median counts."""
BESIDE, DEEP = 0.6, 3.0
"""How far beside, in bead widths, and below, in heights of a layer, an earlier bead carries one."""


def measure_air(path: DepositPath, left: Solid | None) -> Floats:
    """The air (N,) under the foot of the planned bead at the middle of each move that deposits, down to metal or an
    earlier layer, along the layer's normal; 0 on travel, and where nothing is as near as some layers."""
    found = np.zeros(len(path.points))
    own = np.flatnonzero(path.on)
    if not len(own):
        return found
    places, normals = find_middles(path)[own], path.normals[own]
    height = path.heights[path.part[own] - 1]
    below = _find_beads_below(path, places, normals, own)
    if left is not None:
        below = np.minimum(below, _find_metal_below(path, places, normals, own, left))
    air = np.maximum(below - height, 0.0)
    found[own] = np.where(air < (DEEP - 1) * height, air, 0.0)
    return found


def _find_metal_below(path: DepositPath, places: Floats, normals: Floats, own: Ints, left: Mesh) -> Floats:
    """The median distance (K,) down to metal from places across each bead."""
    along = normalise(path.points[own] - path.points[own - 1], 1e-12)
    side = np.cross(normals, along)
    caster = prepare_rays(left)
    depths = [caster.find_first(places + share * path.width * side, -normals)[0] for share in ACROSS]
    return np.asarray(np.median(np.array(depths), axis=0))


def _find_beads_below(path: DepositPath, places: Floats, normals: Floats, own: Ints) -> Floats:
    """The distance (K,) from the middle of each move down to the top of a bead of an earlier layer; inf without."""
    rank = path.part[own] * (int(path.layer.max()) + 1) + path.layer[own]
    height = float(path.heights.max())
    tree = KDTree(places)
    found = np.full(len(own), np.inf)
    pairs = tree.query_pairs(float(np.hypot(BESIDE * path.width, DEEP * height)), output_type="ndarray")
    for upper, lower in (pairs.T, pairs.T[::-1]):
        later = rank[upper] > rank[lower]
        one, other = upper[later], lower[later]
        way = places[one] - places[other]
        up = np.einsum("ij,ij->i", way, normals[one])
        beside = np.linalg.norm(way - up[:, None] * normals[one], axis=1)
        on = (up > 1e-6 * height) & (beside < BESIDE * path.width)
        np.minimum.at(found, one[on], up[on])
    return found


def raise_beads(path: DepositPath, left: Solid | None) -> DepositPath:
    """The path with beads that are higher where there is air under them, so that their foot lies on the metal."""
    if not path.on.any():
        return path
    cut, _ = cut_moves(path, LONGEST)
    sizes = cut.planned_sizes
    more = np.round(np.minimum(measure_air(cut, left) / sizes[:, 1], MOST) / FINE) * FINE
    if not (more >= LEAST - 1e-9).any():
        return cut
    sizes[:, 1] *= 1 + more
    return replace(cut, bead_sizes=sizes)
