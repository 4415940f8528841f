"""Builds stock on smooth patches of skin, each as one solid: much faster to unite than one piece for each triangle."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.geometry.duplicates import find_members
from damageest.geometry.vectors import cross_corners

SLIVER = 1e-9
"""Area of a triangle, in squares of the skin's extent, below which its direction is not checked."""


def build_shells(
    lows: Floats, tops: Floats, group: Ints, pairs: Ints, shared: NDArray[np.bool_]
) -> tuple[list[Any], Ints]:
    """Manifolds between the skin and the top of its stock, one for each patch where the top does not fold.

    Args:
        lows, tops: (F,3,3) lower and upper corners over each triangle.
        group: (3F,) corners of one group have one lower and one upper point.
        pairs: (E,2) neighbouring triangles.
        shared: (E,) whether these have both upper corners in common.

    Returns:
        The Manifolds, and the triangles that are in none of them.
    """
    from manifold3d import Error, Manifold, Mesh64
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count = len(lows)
    links = coo_array((np.ones(int(shared.sum())), (pairs[shared, 0], pairs[shared, 1])), shape=(count, count))
    size, patch = connected_components(links, directed=False)
    folded = np.zeros(size, bool)
    folded[patch[_is_folded(lows, tops)]] = True
    creases = pairs[~shared]
    folded[patch[creases[patch[creases[:, 0]] == patch[creases[:, 1]], 0]]] = True
    made, rest = [], [np.flatnonzero(folded[patch])]
    order = np.argsort(patch, kind="stable")
    for faces in np.split(order, np.flatnonzero(np.diff(patch[order])) + 1):
        if folded[patch[faces[0]]]:
            continue
        _, first, corner = np.unique(group.reshape(-1, 3)[faces], return_index=True, return_inverse=True)
        corner, used = corner.reshape(-1, 3), len(first)
        points = np.concatenate([lows[faces].reshape(-1, 3)[first], tops[faces].reshape(-1, 3)[first]])
        a, b = _find_border(corner)
        sides = [np.stack([a, b, b + used], 1), np.stack([a, b + used, a + used], 1)]
        triangles = np.concatenate([corner[:, ::-1], corner + used, *sides])
        body = Manifold(Mesh64(np.ascontiguousarray(points), np.ascontiguousarray(triangles, dtype=np.uint64)))
        if body.status() == Error.NoError and body.volume() > 0:
            made.append(body)
        else:
            rest.append(faces)
    return made, np.sort(np.concatenate(rest))


def _is_folded(lows: Floats, tops: Floats) -> NDArray[np.bool_]:
    """(F,) whether the upper triangle faces the other way than the lower one, or is smaller than a tenth of it: there
    the radius of the skin is about the height of the stock."""

    def cross(corners: Floats) -> Floats:
        return cross_corners(corners)

    below, above = cross(lows), cross(tops)
    size = np.einsum("ij,ij->i", below, below)
    sliver = (
        size < (SLIVER * np.ptp(lows, axis=(0, 1)).max() ** 2) ** 2
    )  # rounding errors turn these; they do not matter
    return np.asarray(~sliver & (np.einsum("ij,ij->i", below, above) < 0.1 * size))


def _find_border(corner: Ints) -> tuple[Ints, Ints]:
    """Start and end (B,) of the edges of one triangle only, in the direction of that triangle."""
    start, stop = corner.ravel(), corner[:, [1, 2, 0]].ravel()
    size = int(corner.max()) + 1
    lone = ~find_members(start * size + stop, stop * size + start)
    return start[lone], stop[lone]
