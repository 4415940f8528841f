"""Shapes of faces: which plane, cylinder, cone or sphere triangles lie on, and how far points are from it.

All lengths are in one unit, all places in one frame.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import cross_corners, normalise

Kind = Literal["plane", "cylinder", "cone", "sphere"]

ON_SHAPE = 1e-3
"""Distance of the corners from a shape, as a share of their extent, up to which they lie on it."""
LARGEST = 20.0
"""Largest radius, in extents of the triangles: what curves less is taken for no cylinder and no sphere."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A plane, a cylinder, a cone or a sphere without ends.

    ``point`` (3,): on the plane, on the axis, the apex of a cone, or the centre of a sphere. ``axis`` (3,): unit
    vector; the outward normal of a plane; of a cone, from the apex into it; 0 for a sphere. ``size``: the radius; of a
    cone, half its angle in radians; 0 for a plane. ``sign``: 1 where the outside is away from the axis or the centre,
    like on a shaft, -1 like in a hole.
    """

    kind: Kind
    point: Floats
    axis: Floats
    size: float = 0.0
    sign: float = 1.0

    @property
    def has_radius(self) -> bool:
        """Whether ``size`` is a radius."""
        return self.kind in ("cylinder", "sphere")

    def measure(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances (N,) of points (N,3), positive outside, and the outward unit normals (N,3) there."""
        off = points - self.point
        if self.kind == "plane":
            return off @ self.axis, np.broadcast_to(self.axis, points.shape).astype(np.float64)
        along = off @ self.axis
        across = off - along[:, None] * self.axis
        radius = np.linalg.norm(across, axis=1)
        radial = across / np.maximum(radius, 1e-300)[:, None]
        if self.kind == "cone":
            cosine, sine = np.cos(self.size), np.sin(self.size)
            normals = cosine * radial - sine * self.axis
            return self.sign * (radius * cosine - along * sine), self.sign * normals
        return self.sign * (radius - self.size), self.sign * radial

    def find_slopes(self, points: Floats) -> Floats:
        """(N,6) how the distances of points (N,3) change with a rotation vector about the origin and a shift."""
        normals = self.measure(points)[1]
        return np.concatenate([np.cross(points, normals), normals], axis=1)

    def scale(self, centre: Floats, size: float) -> Shape:
        """The same shape about another origin, ``centre`` (3,), in another unit, ``size`` of the present one."""
        radius = self.size / size if self.has_radius else self.size
        return replace(self, point=(self.point - centre) / size, size=radius)

    def is_same(self, other: Shape, reach: float) -> bool:
        """Whether two shapes are one, for example the halves of a bore; ``reach``: largest distance between them."""
        if self.kind != other.kind or self.sign != other.sign:
            return False
        if self.kind == "sphere":
            return bool(np.linalg.norm(self.point - other.point) < reach and abs(self.size - other.size) < reach)
        off = other.point - self.point
        if self.kind == "plane":
            return bool(self.axis @ other.axis > 1 - 1e-8 and abs(off @ self.axis) < reach)
        parallel = abs(self.axis @ other.axis) > 1 - 1e-8
        if self.kind == "cone":
            return bool(parallel and np.linalg.norm(off) < reach and abs(self.size - other.size) < 1e-4)
        beside = np.linalg.norm(off - (off @ self.axis) * self.axis)
        return bool(parallel and beside < reach and abs(self.size - other.size) < reach)


def recognise_shape(triangles: Floats, deviation: float = 0.0) -> Shape | None:
    """The simplest shape that all corners of triangles (F,3,3) lie on, which are counter-clockwise from outside. None
    where they lie on no plane, cylinder, cone or sphere, or have no area.

    ``deviation``: further permitted distance of corners.
    """
    cross = cross_corners(triangles)
    area = np.linalg.norm(cross, axis=1)
    if not len(area) or not area.sum() > 0:
        return None
    normals, corners = normalise(cross), triangles.reshape(-1, 3)
    extent = float(np.linalg.norm(np.ptp(corners, axis=0)))
    limit = ON_SHAPE * extent + deviation
    middle = np.average(triangles.mean(axis=1), axis=0, weights=area)
    for find in (_find_plane, _find_cylinder, _find_cone, _find_sphere):
        shape = find(triangles - middle, normals, area)
        if shape is None or (shape.has_radius and not shape.size < LARGEST * extent):
            continue
        inside = np.einsum("ij,ij->i", shape.measure(triangles.mean(axis=1) - middle)[1], normals)
        if float(inside @ area) < 0:
            shape = replace(shape, sign=-shape.sign)
        distance, outward = shape.measure(corners - middle)
        turned = np.einsum("ij,ij->i", outward, np.repeat(normals, 3, axis=0))
        known = np.repeat(area, 3) > 1e-6 * area.max()
        if shape.kind == "cone":  # its apex has no normal
            known &= np.linalg.norm(corners - middle - shape.point, axis=1) > limit
        if np.abs(distance).max() < limit and turned[known].min(initial=1.0) > 0.5:
            return replace(shape, point=shape.point + middle)
    return None


def _find_plane(triangles: Floats, normals: Floats, area: Floats) -> Shape | None:
    return Shape("plane", np.zeros(3), normalise((area @ normals)[None])[0])


def _find_cylinder(triangles: Floats, normals: Floats, area: Floats) -> Shape | None:
    """The normals of a cylinder's facets are across its axis; its corners lie on a circle as seen along it."""
    axis = np.linalg.eigh((normals * area[:, None]).T @ normals)[1][:, 0]
    centre, radius = _fit_centre(triangles.reshape(-1, 3), np.eye(3) - np.outer(axis, axis))
    return Shape("cylinder", centre, axis, radius)


def _find_sphere(triangles: Floats, normals: Floats, area: Floats) -> Shape | None:
    centre, radius = _fit_centre(triangles.reshape(-1, 3), np.eye(3))
    return Shape("sphere", centre, np.zeros(3), radius)


def _find_cone(triangles: Floats, normals: Floats, area: Floats) -> Shape | None:
    """The normals of a cone's facets have one angle to its axis, and their planes meet in its apex."""
    off = normals - area @ normals / area.sum()
    axis = np.linalg.eigh((off * area[:, None]).T @ off)[1][:, 0]
    root = np.sqrt(area)
    apex = np.linalg.lstsq(normals * root[:, None], root * np.einsum("ij,ij->i", normals, triangles[:, 0]), rcond=1e-9)[
        0
    ]
    corners = triangles.reshape(-1, 3) - apex
    if np.median(corners @ axis) < 0:
        axis = -axis
    along = corners @ axis
    across = np.linalg.norm(corners - along[:, None] * axis, axis=1)
    if not (along > 0).any():
        return None
    angle = float(np.arctan2(across.sum(), along.sum()))
    return Shape("cone", apex, axis, angle) if 1e-3 < angle < np.pi / 2 - 1e-3 else None


def _fit_centre(points: Floats, flat: Floats) -> tuple[Floats, float]:
    """Centre (3,) and radius of the circle or sphere through points (N,3), projected by ``flat`` (3,3) (Kasa 1976)."""
    at = points @ flat
    rows = np.concatenate([2 * at, np.ones((len(at), 1))], axis=1)
    found = np.linalg.lstsq(rows, (at**2).sum(axis=1), rcond=1e-9)[0]
    centre = flat @ found[:3]
    return centre, float(np.sqrt(max(found[3] + centre @ centre, 0.0)))
