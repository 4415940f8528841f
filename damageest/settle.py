"""From what the Booleans gave to the sites of the job.

A site is what belongs together: clusters of inner-damage-surface (IDS) points that bound one piece of lost material,
and the pieces that one cluster bounds. So a section missing from a ring is one site with two clusters, and a cut that
takes two teeth at once is one site with two pieces. Pieces that no IDS point touches are scraps of the method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh, Part, Solid, Surface
from damageest.lattice import cubes

ENOUGH = 5
"""IDS points that have to lie on a piece for it to count."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One connected piece of lost material and the clusters whose points lie on it."""

    solid: Solid
    clusters: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Settled:
    """One site: ``damage`` (of one or more pieces) and its ``clusters``; ``dropped`` volume of scraps beside it."""

    damage: Solid
    clusters: tuple[int, ...]


def pieces_of(damage: Solid, points: Floats, label: Ints, reach: float) -> tuple[list[Piece], float]:
    """Splits a damage volume and drops what no IDS point touches.

    Args:
        points, label: (M,3) IDS points in the part's frame, and the cluster of each.
        reach: how far from a piece a point may lie and still bound it.

    Returns:
        The pieces, and the volume of what was dropped.
    """
    import igl

    from damageest.solids import bodies

    origin = damage.bounds.mean(axis=0)
    solids = bodies(damage)
    vertices, faces, owner = _joined(solids)
    # of points much closer together than the reach, one speaks for those about it
    cell = cubes(points, reach / 2)[1]
    _, first, counts = np.unique(np.stack([cell, label]), axis=1, return_index=True, return_counts=True)
    squared, face, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(points[first] - origin), np.ascontiguousarray(vertices - origin), faces
    )
    near = squared < reach**2
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


def sites_of(pieces: Sequence[Piece]) -> list[Settled]:
    """Joins pieces and clusters that belong together; largest site first. Overlaps between pieces are united."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    from damageest.solids import to_solid, united

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
        whole = members[0].solid if len(members) == 1 else to_solid(united((m.solid for m in members), origin), origin)
        if whole is not None:
            found.append(Settled(whole, clusters))
    return sorted(found, key=lambda site: -site.damage.volume)


def inner_faces(damage: Solid, part: Part) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which faces (F,) of a damage volume lie inside the part rather than on its skin."""
    import igl

    origin = part.bounds.mean(axis=0)
    corners = damage.triangles - origin
    # Three points inside each triangle: a face of the cut may touch the skin at a corner or along an edge.
    weights = np.array([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])
    probes = np.einsum("pk,fkj->fpj", weights, corners).reshape(-1, 3)
    squared, _, _ = igl.point_mesh_squared_distance(
        np.ascontiguousarray(probes), np.ascontiguousarray(part.vertices - origin), np.array(part.faces)
    )
    limit = (1e-7 * part.diagonal) ** 2
    return np.asarray(squared.reshape(-1, 3).max(axis=1) > limit)


def ids_surface(damage: Solid, part: Part) -> Surface:
    """The inner damage surface of a damage volume: its faces inside the part, turned toward the lost material."""
    faces = damage.faces[inner_faces(damage, part)][:, ::-1]
    used, renumbered = np.unique(faces, return_inverse=True)
    return Surface(damage.vertices[used], renumbered.reshape(-1, 3))


def _joined(meshes: Sequence[Mesh]) -> tuple[Floats, Ints, Ints]:
    """Vertices and faces of several meshes as one, and the mesh that each face came from."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])
    return vertices, faces, owner
