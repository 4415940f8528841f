"""Surface reconstruction by the signed distance to tangent planes."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Part, Surface
from damageest.geometry.local_fits import smooth_points
from damageest.geometry.open_surfaces import centre_points, thin_for_surface, trim_surface
from damageest.stages.reconstruct import Reconstruct

SMOOTHED = 32
"""Points of each local fit, which takes curvature and so averages less than a plane through as many."""
MOST_CELLS = 3e6
"""Cells in the box of a damage; VTK visits each, at some 2 microseconds."""


class PyVista(Reconstruct):
    """Hoppe et al. 1992, by VTK through PyVista (paper 3.1 step 5), of points moved onto local fits first: VTK lays its
    tangent planes through the points as they are. Wants fairly even density."""

    use: Literal["pyvista"] = "pyvista"
    neighbours: int = Field(20, ge=5, le=200, description="points of each tangent plane; half of a small site")
    spacing: float | None = Field(
        None,
        gt=0,
        description="edge of the cells, in the job's unit; default: the larger of tolerance and point spacing, more "
        "where the damage's box would hold more than three million cells",
    )

    def run(self, points: Floats, part: Part, tolerance: float, spacing: float, noise: float) -> Surface:
        """Raises StageError where the points are too few, or no surface comes about."""
        import pyvista

        origin = centre_points(points)
        # VTK fills the bounding box with cells; along its own axes a damage's box is a fraction of the part's.
        axes = np.linalg.eigh((points - origin).T @ (points - origin))[1]
        local = (points - origin) @ axes
        least = float(np.prod(np.ptp(local, axis=0)) / MOST_CELLS) ** (1 / 3)
        cell = self.spacing or max(tolerance, spacing, least)
        cloud = thin_for_surface(local, cell)
        count = min(self.neighbours, len(cloud) // 2)
        cloud, _, _ = smooth_points(cloud, noise, min(max(count, SMOOTHED), len(cloud) // 2))
        mesh = pyvista.PolyData(cloud).reconstruct_surface(nbr_sz=count, sample_spacing=cell)
        mesh = mesh.triangulate().clean() if mesh.n_cells else mesh
        vertices, faces = np.asarray(mesh.points, np.float64), mesh.regular_faces.astype(np.int64)
        # The filter's level goes on beyond the data, and where it overshoots the part it bounds no lost material.
        return trim_surface(vertices @ axes.T + origin, faces, cloud @ axes.T + origin, 1.4 * cell, part, tolerance)
