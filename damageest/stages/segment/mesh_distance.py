"""Exact signed distance of each scan point to the part's triangles (paper 3.1 step 4, its exact variant)."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from damageest.artefacts import ADDED, DAMAGE, INTACT, Deviation, Floats, Ints, Mesh, Part, Scan
from damageest.stages.segment import Segment
from damageest.stages.segment._averaged import worn
from damageest.stages.segment._cells import by_cells

MANY = 100_000
"""Scan points beyond which not each of them is searched for."""


class MeshDistance(Segment):
    """Signed distance to the triangles themselves, so no CAD sampling limits it."""

    use: Literal["mesh_distance"] = "mesh_distance"
    threshold: float = Field(
        1.0, gt=0, description="distance from the part beyond which a point is damage or added metal, in tolerances"
    )
    wear: bool = Field(
        True, description="also label as damage what is worn by less than that, where the mean over neighbours shows it"
    )

    def run(self, aligned: Scan, part: Part, tolerance: float) -> Deviation:
        """Distance (N,), positive outside, in the job's unit; nearest triangle (N,); label (N,)."""
        limit = self.threshold * tolerance
        if len(aligned.points) > max(MANY, 4 * len(part.faces)):
            points, near = aligned.points, 0.5 * min(limit, tolerance)
            distance, face = by_cells(points, part, near, lambda some: signed_distance(some, part))
        else:
            distance, face = signed_distance(aligned.points, part)
        label = np.full(len(distance), INTACT, np.uint8)
        label[distance < -limit] = DAMAGE
        label[distance > limit] = ADDED
        notes: tuple[str, ...] = ()
        if self.wear:
            found = worn(aligned, part, distance, face, limit)
            label[found.worn] = DAMAGE
            notes = found.notes
        return Deviation(distance=distance, face=face, label=label, notes=notes)


def signed_distance(points: Floats, part: Mesh) -> tuple[Floats, Ints]:
    """Distance (N,) of ``points`` (N,3) to a watertight mesh, positive outside, and the nearest triangle (N,).

    The sign is that of the angle-weighted pseudonormal (Baerentzen and Aanaes 2005), exact on a clean watertight mesh.
    Where the nearest point lies on an edge or corner that flat, slender or doubled triangles touch, as CAD
    tessellations have, the pseudonormal is unsound and the winding number gives the sign instead.
    """
    import igl

    if not len(points):
        return np.empty(0), np.empty(0, np.int64)
    centre = part.bounds.mean(axis=0)  # far from the origin, differences of coordinates lose digits
    vertices = part.vertices - centre
    query = points - centre
    scale = part.diagonal
    flat = _flat(part, scale)
    # Without the flat triangles the surface is the same set of points, and no normal of it is undefined.
    used = np.flatnonzero(~flat)
    faces = part.faces[used]
    kind = igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
    signed, nearest, foot, pseudo = igl.signed_distance(query, vertices, faces, sign_type=kind)
    signed = np.array(signed, dtype=np.float64)
    nearest = np.asarray(nearest, np.int64)

    away = query - foot
    cross = part.cross[used]
    normal = (cross / np.linalg.norm(cross, axis=1, keepdims=True))[nearest]
    beside = np.linalg.norm(np.cross(away, normal), axis=1) > 1e-7 * np.abs(signed)
    # libigl takes a point on the short edge of a slender triangle for one in its middle, and that face's normal for the
    # pseudonormal: seen at 4 of 70,000 points round a tube with a hole, millimetres off, and with the wrong sign.
    doubtful = beside & (np.einsum("ij,ij->i", pseudo, normal) > (1 - 1e-9) * np.linalg.norm(pseudo, axis=1))
    if (unsound := _unsound_vertices(part, flat, scale)).any():
        doubtful |= beside & unsound[faces[nearest]].any(axis=1)
    if doubtful.any():
        winding = np.asarray(igl.fast_winding_number(vertices, part.faces, query[doubtful])).ravel()
        signed[doubtful] = np.where(winding > 0.5, -1.0, 1.0) * np.abs(signed[doubtful])
    return signed, used[nearest]


def _flat(part: Mesh, scale: float) -> NDArray[np.bool_]:
    """(F,) whether a triangle's height over its longest edge is below what float64 coordinates resolve."""
    triangles = part.triangles
    longest = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
    result: NDArray[np.bool_] = np.linalg.norm(part.cross, axis=1) <= 1e-10 * scale * np.maximum(longest, 1e-10 * scale)
    return result


def _unsound_vertices(part: Mesh, flat: NDArray[np.bool_], scale: float) -> NDArray[np.bool_]:
    """(V,) whether a vertex belongs to a flat triangle or lies on top of another vertex."""
    unsound = np.zeros(len(part.vertices), bool)
    unsound[part.faces[flat]] = True
    cell = np.round((part.vertices - part.bounds[0]) / (1e-9 * scale)).astype(np.int64)
    used = np.unique(part.faces)
    _, inverse, count = np.unique(cell[used], axis=0, return_inverse=True, return_counts=True)
    unsound[used[(count > 1)[inverse.ravel()]]] = True
    return unsound
