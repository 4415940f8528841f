"""From what the Booleans gave to the sites of the job.

A site is what belongs together: clusters of inner-damage-surface (IDS) points that bound one piece of lost material,
and the pieces that one cluster bounds. So a section missing from a ring is one site with two clusters, and a cut that
takes two teeth at once is one site with two pieces. Pieces that no IDS point touches are scraps of the method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.bodies import split_bodies
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.solids import concatenate_meshes
from damageest.geometry.voxels import number_cubes

ENOUGH = 5
"""IDS points that have to lie on a piece for it to count."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One connected piece of lost material and the clusters whose points lie on it."""

    solid: Solid
    clusters: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class JoinedPieces:
    """One site: ``damage`` (of one or more pieces) and its ``clusters``; ``dropped`` volume of scraps beside it."""

    damage: Solid
    clusters: tuple[int, ...]


def find_pieces(damage: Solid, points: Floats, label: NDArray[np.integer], reach: float) -> tuple[list[Piece], float]:
    """Splits a damage volume and drops what no IDS point touches.

    Args:
        points, label: (M,3) IDS points in the part's frame, and the cluster of each.
        reach: how far from a piece a point may lie and still bound it.

    Returns:
        The pieces, and the volume of what was dropped.
    """
    solids = split_bodies(damage)
    vertices, faces, owner = concatenate_meshes(solids)
    # of points much closer together than the reach, one speaks for those about it
    cell = number_cubes(points, reach / 2)[1]
    _, first, counts = np.unique(np.stack([cell, label]), axis=1, return_index=True, return_counts=True)
    distance, face, _ = closest_on_mesh(points[first], Mesh(vertices, faces))
    near = distance < reach
    touching = np.zeros((len(solids), int(label.max(initial=0)) + 1), np.int64)
    np.add.at(touching, (owner[face[near]], label[first[near]]), counts[near])
    kept, dropped = [], 0.0
    for solid, counts in zip(solids, touching, strict=True):
        if counts.max() >= ENOUGH:
            enough = counts >= max(ENOUGH, 0.02 * counts.max())
            kept.append(Piece(solid, tuple(int(c) for c in np.flatnonzero(enough))))
        else:
            dropped += solid.volume
    return kept, dropped


def join_pieces(pieces: Sequence[Piece]) -> list[JoinedPieces]:
    """Joins pieces and clusters that belong together; largest site first. Overlaps between pieces are united."""
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
