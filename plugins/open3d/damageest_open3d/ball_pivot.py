"""Ball pivoting by Open3D."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.geometry.edges import list_edges
from damageest.geometry.vectors import normalise
from damageest.stages.reconstruct import Reconstruct

LEAST_AGREED = 0.7
"""Cosine between the normals at the ends of an edge below which it crosses a sharp edge of the damage, and stays
straight."""


class BallPivot(Reconstruct):
    """Ball pivoting (Bernardini et al. 1999), by Open3D. Gaps wider than the largest ball stay holes.

    Three points form a triangle where a ball rests on them. The points are first moved onto local fits. Each triangle
    is then divided in four, the middles of its edges on the arcs that the normals at their ends give: the chords of a
    hollow would make it smaller. The surface ends exactly where the points end.
    """

    isolated: ClassVar[bool] = True
    use: Literal["ball_pivot"] = "ball_pivot"
    radii: tuple[PositiveFloat, ...] = Field(
        (1.5, 3.0),
        min_length=1,
        description="radii of the balls, in units of `spacing`; each larger ball fills gaps that the smaller ones left",
    )
    spacing: float | None = Field(
        None,
        gt=0,
        description="spacing of the points that the ball rolls on, in the job's unit; default: the larger of tolerance "
        "and point spacing",
    )

    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface:
        """Raises StageError where the points are too few, or where no surface can be reconstructed."""
        from damageest.geometry.open_surfaces import centre_points, orient_points, trim_surface

        cell = self.spacing or max(tolerance, spacing)
        origin = centre_points(points)
        cloud, normals = orient_points(points, part, cell, noise)
        faces = _pivot_ball(cloud - origin, normals, [radius * cell for radius in sorted(self.radii)])
        vertices, faces = _round_faces(cloud, normals, faces)
        return trim_surface(vertices, faces, cloud, np.inf, part, tolerance)


def _pivot_ball(points: Floats, normals: Floats, radii: list[float]) -> Ints:
    """Triangles (F,3) between points (N,3) with ``normals`` (N,3), by Open3D."""
    from damageest_open3d._system import check

    check()
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.normals = o3d.utility.Vector3dVector(normals)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        mesh = o3d.geometry.TriangleMesh.create_from_point_cloud_ball_pivoting(cloud, o3d.utility.DoubleVector(radii))
    return np.asarray(mesh.triangles).astype(np.int64)


def _round_faces(points: Floats, normals: Floats, faces: Ints) -> tuple[Floats, Ints]:
    """Points (N+E,3) and triangles (4F,3): each triangle (F,3) divided in four, with the middle of each of its E edges
    moved off the chord onto the arc between the tangent planes at its ends (after Vlachos et al. 2001, section 3.1)."""
    if not len(faces):
        return points, faces
    ends, inverse = np.unique(list_edges(faces), axis=0, return_inverse=True)
    start, stop = points[ends[:, 0]], points[ends[:, 1]]
    first, second = normals[ends[:, 0]], normals[ends[:, 1]]
    height = np.einsum("ij,ij->i", second - first, stop - start) / 8
    height[np.einsum("ij,ij->i", first, second) < LEAST_AGREED] = 0
    middle = (start + stop) / 2 + height[:, None] * normalise(first + second)
    a, b, c = faces.T
    ab, bc, ca = (inverse.reshape(-1, 3) + len(points)).T
    quarters = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    return np.concatenate([points, middle]), np.concatenate([np.stack(corners, axis=1) for corners in quarters])
