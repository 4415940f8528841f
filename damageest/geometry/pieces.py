"""The sites of a damage volume: its pieces, and the clusters of inner-damage-surface (IDS) points that bound them.

Clusters that bound one piece of lost metal, and pieces that one cluster bounds, belong to one site. So a section
missing from a ring is one site with two clusters, and a cut through two teeth is one site with two pieces. Pieces with
hardly any IDS point on them are errors of the method; they are dropped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.bodies import split_bodies
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.neighbourhoods import find_in_box
from damageest.geometry.solids import concatenate_meshes
from damageest.geometry.voxels import number_cubes

FEWEST_POINTS = 5
"""IDS points of one cluster that have to lie on a piece, or the piece is dropped."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One connected piece of lost metal, and the numbers of the clusters whose points lie on it."""

    solid: Solid
    clusters: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class JoinedPieces:
    """One site: its ``damage`` of one or more pieces, and the numbers of its ``clusters``."""

    damage: Solid
    clusters: tuple[int, ...]


def find_pieces(damage: Solid, points: Floats, label: NDArray[np.integer], reach: float) -> tuple[list[Piece], float]:
    """The pieces of a damage volume that IDS points bound, and the volume of those dropped.

    Args:
        damage: the damage volume, of one or more connected pieces.
        points: (N,3) IDS points, in the unit and frame of ``damage``.
        label: (N,) the cluster of each point, not negative.
        reach: distance from a piece up to which a point counts as lying on it.

    A piece is dropped where fewer than FEWEST_POINTS points of every cluster lie on it. A cluster bounds a
    piece if at least FEWEST_POINTS of its points lie there, and at least 2 % as many as of the cluster with most.
    """
    solids = split_bodies(damage)
    vertices, faces, owner = concatenate_meshes(solids)
    # points far from all pieces, as those of other losses are, take the most time and count for nothing
    low, high = damage.bounds
    asked = find_in_box(points, low - 1.001 * reach, high + 1.001 * reach)
    points, label, clusters = points[asked], label[asked], int(label.max(initial=0)) + 1
    if not len(points):
        return [], sum(solid.volume for solid in solids)
    # of points much closer together than the reach, the distance is computed for one
    cell = number_cubes(points, reach / 2)[1]
    _, first, counts = np.unique(np.stack([cell, label]), axis=1, return_index=True, return_counts=True)
    distance, face, _ = closest_on_mesh(points[first], Mesh(vertices, faces))
    near = distance < reach
    touching = np.zeros((len(solids), clusters), np.int64)
    np.add.at(touching, (owner[face[near]], label[first[near]]), counts[near])
    kept, dropped = [], 0.0
    for solid, counts in zip(solids, touching, strict=True):
        if counts.max() >= FEWEST_POINTS:
            enough = counts >= max(FEWEST_POINTS, 0.02 * counts.max())
            kept.append(Piece(solid, tuple(int(c) for c in np.flatnonzero(enough))))
        else:
            dropped += solid.volume
    return kept, dropped


def join_pieces(pieces: Sequence[Piece]) -> list[JoinedPieces]:
    """The sites that pieces and clusters form, largest damage first.

    Pieces that share a cluster, directly or through other pieces, become one site. Where pieces overlap, their union is
    taken. Unit and frame are those of the pieces. Raises ValueError where manifold3d rejects a piece.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    from damageest.geometry.solids import to_solid, unite

    if not pieces:
        return []
    pairs = np.array([(i, c) for i, piece in enumerate(pieces) for c in piece.clusters])
    size = len(pieces) + int(pairs[:, 1].max()) + 1
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1] + len(pieces))), shape=(size, size))
    _, group = connected_components(links, directed=False)
    found = []
    for number in dict.fromkeys(group[: len(pieces)].tolist()):
        members = [piece for piece, g in zip(pieces, group[: len(pieces)], strict=True) if g == number]
        clusters = tuple(sorted({c for piece in members for c in piece.clusters}))
        origin = members[0].solid.bounds.mean(axis=0)
        whole = members[0].solid if len(members) == 1 else to_solid(unite((m.solid for m in members), origin), origin)
        if whole is not None:
            found.append(JoinedPieces(whole, clusters))
    return sorted(found, key=lambda site: -site.damage.volume)
