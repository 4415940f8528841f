"""Ball pivoting by Open3D."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, PositiveFloat

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.stages.reconstruct import Reconstruct


class BallPivot(Reconstruct):
    """Ball pivoting (Bernardini et al. 1999), by Open3D. Needs even density, or radii that bridge the gaps.

    Three points form a triangle where a ball rests on them. The points are first moved onto local fits. The surface
    ends exactly where the points end.
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
        return trim_surface(cloud, faces, cloud, np.inf, part, tolerance)


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
