"""Damage surfaces by PyMeshLab's reconstruction filters."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.errors import StageError
from damageest.stages.reconstruct import Reconstruct

Filter = Literal["apss", "rimls", "ball_pivoting", "screened_poisson"]
MOST_LEVELS = 11
"""Most levels of the Poisson octree; one more takes four times the memory."""


class PyMeshLabReconstruct(Reconstruct):
    """Reconstruction by one of PyMeshLab's filters, trimmed to the points.

    The points are first moved onto local fits. Filters: `screened_poisson` (Kazhdan and Hoppe 2013), for uneven
    density; `apss` (Guennebaud and Gross 2007), which fits spheres, and `rimls` (Oztireli et al. 2009), which keeps
    creases sharper: both are faster, but their results differ in the seventh digit from run to run; `ball_pivoting`,
    whose surface passes through the points.
    """

    isolated: ClassVar[bool] = True
    use: Literal["pymeshlab"] = "pymeshlab"
    filter: Filter = Field("screened_poisson", description="PyMeshLab's filter")
    scale: float = Field(
        3.0, gt=0.5, le=20, description="for `apss` and `rimls`: radius of each local fit, in point spacings"
    )
    radius: float = Field(
        1.5, gt=0.5, le=20, description="for `ball_pivoting`: radius of the ball, in units of `spacing`"
    )
    spacing: float | None = Field(
        None,
        gt=0,
        description="edge of the cells, in the job's unit; default: the larger of tolerance and point spacing, or more "
        "where the damage would need over three million cells",
    )

    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface:
        """Raises StageError where the points are too few, or where no surface can be reconstructed."""
        from damageest.geometry.open_surfaces import centre_points, choose_cell, orient_points, trim_surface

        origin = centre_points(points)
        # Marching cubes fills the bounding box with cells. Along the damage's own axes that box is much smaller.
        axes = np.linalg.eigh((points - origin).T @ (points - origin))[1]
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])  # a rotation, so that faces keep their orientation
        size = np.ptp((points - origin) @ axes, axis=0)
        cell = choose_cell(size, tolerance, spacing, self.spacing)
        cloud, normals = orient_points(points, part, cell, noise)
        vertices, faces = _apply_filter(
            (cloud - origin) @ axes, normals @ axes, *self._choose_filter(cell, float(size.max()))
        )
        return trim_surface(vertices @ axes.T + origin, faces, cloud, 1.4 * cell, part, tolerance)

    def _choose_filter(self, cell: float, size: float) -> tuple[str, dict[str, Any]]:
        """PyMeshLab's name of the filter and its parameters; ``size`` is the longest side of the points' box."""
        if self.filter == "screened_poisson":
            depth = int(np.ceil(np.log2(max(1.1 * size / cell, 2))))
            # With several threads the sums differ from run to run.
            return "generate_surface_reconstruction_screened_poisson", {"depth": min(depth, MOST_LEVELS), "threads": 1}
        if self.filter == "ball_pivoting":
            return "generate_surface_reconstruction_ball_pivoting", {"ballradius": self.radius * cell}
        resolution = int(np.ceil(size / cell)) + 1
        return f"generate_marching_cubes_{self.filter}", {"filterscale": self.scale, "resolution": resolution}


def _apply_filter(points: Floats, normals: Floats, name: str, parameters: dict[str, Any]) -> tuple[Floats, Ints]:
    """Vertices (V,3) and faces (F,3) that a filter makes from oriented points (N,3)."""
    from damageest_pymeshlab._system import check

    check()
    import pymeshlab

    if "ballradius" in parameters:
        parameters = parameters | {"ballradius": pymeshlab.PureValue(parameters["ballradius"])}
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertex_matrix=points, v_normals_matrix=normals))
    try:
        meshes.apply_filter(name, **parameters)
    except pymeshlab.PyMeshLabException as error:
        raise StageError(
            f"PyMeshLab could not reconstruct a surface: {str(error).strip()}", "another filter", method="implicit"
        ) from None
    result = meshes.current_mesh()
    return np.asarray(result.vertex_matrix(), np.float64), result.face_matrix().astype(np.int64)
