"""Where a damage volume ends because the scan ends there: its rim beside skin that the scan does not show.

Skin is beside a loss where it faces as the lost skin next to it does. The other side of a thin wall is near, and is not
beside it.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Solid
from damageest.findings import Coverage
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest.geometry.edges import pair_faces
from damageest.geometry.neighbourhoods import find_neighbours
from damageest.geometry.skin import find_inner_faces, take_lost_skin

OPPOSITE = -0.5
"""Cosine between two normals below which they belong to two sides of a wall."""


def measure_unseen_rim(damage: Solid, part: Part, coverage: Coverage, reach: float) -> float:
    """Share of the length of the rim within ``reach`` of an unseen region of the skin; 0 without a rim.

    The rim are the edges between the faces of the damage volume inside the part and those on the skin.
    """
    inner = find_inner_faces(damage, part)
    unseen = coverage.skin.triangles[find_unseen_beside(coverage, damage, inner, reach)].mean(axis=1)
    start, end = _find_rim(damage, inner)
    if not len(unseen) or not len(start):
        return 0.0
    length = np.linalg.norm(end - start, axis=1)
    gap = find_neighbours((start + end) / 2, 1, unseen, reach)[0].ravel()
    return float(length[np.isfinite(gap)].sum() / max(float(length.sum()), 1e-300))


def find_unseen_beside(coverage: Coverage, damage: Solid, inner: Flags, reach: float) -> Ints:
    """The unseen cells (M,) of the skin that lie within ``reach`` of the skin that a damage volume removes, and face as
    it does there. ``inner`` (F,): which faces of ``damage`` are inside the part."""
    centres = coverage.skin.triangles.mean(axis=1)
    low, high = damage.bounds[0] - reach, damage.bounds[1] + reach
    near = np.flatnonzero((coverage.region >= 0) & ((centres > low) & (centres < high)).all(axis=1))
    if not len(near) or inner.all():
        return np.empty(0, dtype=np.int64)
    near = near[distance_to_mesh(centres[near], take_lost_skin(damage, inner)) < reach]
    return np.asarray(near[face_alike(centres[near], coverage.skin.face_normals[near], damage, inner)])


def face_alike(places: Floats, normals: Floats, damage: Solid, inner: Flags) -> Flags:
    """Which places (N,3) of the skin, of outward ``normals`` (N,3), are on the same side of a wall as a damage volume:
    they face as the nearest skin that it removes. ``inner`` (F,): which of its faces are inside the part."""
    if inner.all() or not len(places):
        return np.zeros(len(places), bool)
    lost = take_lost_skin(damage, inner)
    _, face, _ = closest_on_mesh(places, lost)
    return np.asarray(np.einsum("ij,ij->i", normals, lost.face_normals[face]) > OPPOSITE)


def _find_rim(damage: Solid, inner: Flags) -> tuple[Floats, Floats]:
    """The ends (E,3) of the edges that belong to one face inside the part and one on the skin."""
    starts, ends, first, second = pair_faces(damage.faces)
    rim = inner[first] != inner[second]
    return damage.vertices[starts[rim]], damage.vertices[ends[rim]]
