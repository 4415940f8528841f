"""Surface reconstruction by VTK's signed distance to oriented points."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.geometry.open_surfaces import centre_points, choose_cell, draw_to_points, orient_points, trim_surface
from damageest.stages.reconstruct import Reconstruct


class SignedDistance(Reconstruct):
    """The zero level of the signed distance to oriented points, after Curless and Levoy 1996 (paper 3.1 step 5).

    By VTK (vtkSignedDistance and vtkExtractSurface): the distance is the weighted mean of the heights over the tangent
    planes of nearby points. Over a hollow that mean is too deep; the surface is drawn back to the points.
    """

    modules: ClassVar[tuple[str, ...]] = ("pyvista",)
    use: Literal["signed_distance"] = "signed_distance"
    spacing: float | None = Field(
        None,
        gt=0,
        description="edge of the cells, in the job's unit; default: the larger of tolerance and point spacing, or more "
        "where the damage would need over three million cells",
    )
    radius: float = Field(
        2.0,
        ge=1.5,
        le=8,
        description="largest distance from a point at which the distance is computed, in cells; a larger radius "
        "bridges wider gaps and rounds curved places",
    )

    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface:
        """Raises StageError where the points are too few, or where no surface can be reconstructed."""
        origin = centre_points(points)
        # VTK fills the bounding box with cells. Along the damage's own axes that box is much smaller.
        axes = np.linalg.eigh((points - origin).T @ (points - origin))[1]
        local = (points - origin) @ axes
        cell = choose_cell(np.ptp(local, axis=0), tolerance, spacing, self.spacing)
        cloud, normals = orient_points(points, part, cell, noise)
        vertices, faces = _extract_zero_level((cloud - origin) @ axes, normals @ axes, cell, self.radius * cell)
        if np.linalg.det(axes) < 0:
            faces = faces[:, ::-1]
        vertices = draw_to_points(vertices @ axes.T + origin, faces, cloud, normals)
        return trim_surface(vertices, faces, cloud, 1.4 * cell, part, tolerance)


def _extract_zero_level(points: Floats, normals: Floats, cell: float, radius: float) -> tuple[Floats, Ints]:
    """Vertices (V,3) and triangles (F,3) of the surface where the signed distance to oriented points (N,3) is 0.

    The surface ends at ``radius`` from the points.
    """
    import pyvista
    from vtkmodules.vtkFiltersPoints import vtkExtractSurface, vtkSignedDistance

    cloud = pyvista.PolyData(points)
    # The filter accepts only single-precision normals.
    cloud.point_data.SetNormals(pyvista.convert_array(np.ascontiguousarray(normals, np.float32), name="Normals"))
    low, high = points.min(axis=0) - 2 * cell, points.max(axis=0) + 2 * cell
    counts = np.ceil((high - low) / cell).astype(int) + 1
    high = low + (counts - 1) * cell
    distance = vtkSignedDistance()
    distance.SetInputData(cloud)
    distance.SetDimensions(*(int(n) for n in counts))
    distance.SetBounds(*np.column_stack([low, high]).ravel())
    distance.SetRadius(radius)
    extract = vtkExtractSurface()
    extract.SetInputConnection(distance.GetOutputPort())
    extract.SetRadius(radius)
    extract.HoleFillingOff()
    extract.ComputeNormalsOff()
    extract.ComputeGradientsOff()
    extract.Update()
    mesh = pyvista.wrap(extract.GetOutput())
    if not mesh.n_cells:
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    # The filter makes some corners twice.
    mesh = mesh.triangulate().clean()
    return np.asarray(mesh.points, np.float64), np.asarray(mesh.regular_faces, np.int64)
