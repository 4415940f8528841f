"""Surface reconstruction by the signed distance to tangent planes."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.geometry.local_fits import smooth_points
from damageest.geometry.open_surfaces import centre_points, choose_cell, thin_for_surface, trim_surface
from damageest.stages.reconstruct import Reconstruct

FIT_POINTS = 32
"""Points of each local fit. It fits curvature too, and so averages less than a plane through as many points."""


class PyVista(Reconstruct):
    """Reconstruction after Hoppe et al. 1992, by VTK through PyVista (paper 3.1 step 5). Needs fairly even density.

    The points are first moved onto local fits, because VTK's tangent planes follow the noise of the points.
    """

    modules: ClassVar[tuple[str, ...]] = ("pyvista",)
    use: Literal["pyvista"] = "pyvista"
    neighbours: int = Field(
        20, ge=5, le=200, description="points of each tangent plane; at most half of the site's points"
    )
    spacing: float | None = Field(
        None,
        gt=0,
        description="edge of the cells, in the job's unit; default: the larger of tolerance and point spacing, or more "
        "where the damage would need over three million cells",
    )

    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface:
        """Raises StageError where the points are too few, or where no surface can be reconstructed."""
        import pyvista

        origin = centre_points(points)
        # VTK fills the bounding box with cells. Along the damage's own axes that box is much smaller.
        axes = np.linalg.eigh((points - origin).T @ (points - origin))[1]
        local = (points - origin) @ axes
        cell = choose_cell(np.ptp(local, axis=0), tolerance, spacing, self.spacing)
        cloud = thin_for_surface(local, cell)
        count = min(self.neighbours, len(cloud) // 2)
        cloud, _, _ = smooth_points(cloud, noise, min(max(count, FIT_POINTS), len(cloud) // 2))
        mesh = pyvista.PolyData(cloud).reconstruct_surface(nbr_sz=count, sample_spacing=cell)
        mesh = mesh.triangulate().clean() if mesh.n_cells else mesh
        vertices, faces = np.asarray(mesh.points, np.float64), mesh.regular_faces.astype(np.int64)
        # The filter continues the surface beyond the points and beyond the part; there it bounds no lost metal.
        return trim_surface(vertices @ axes.T + origin, faces, cloud @ axes.T + origin, 1.4 * cell, part, tolerance)
