"""Surface reconstruction by the signed distance to tangent planes."""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import Floats, Ints, Part, Surface
from damageest.errors import StageError
from damageest.stages.reconstruct import Reconstruct

FEWEST = 16
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
        from scipy.spatial import cKDTree

        from damageest.stages.enclose._fit import smoothed, thinned
        from damageest.stages.reconstruct._oriented import middle
        from damageest.stages.segment.mesh_distance import signed_distance

        origin = middle(points)
        # VTK fills the bounding box with cells; along its own axes a damage's box is a fraction of the part's.
        axes = np.linalg.eigh((points - origin).T @ (points - origin))[1]
        local = (points - origin) @ axes
        least = float(np.prod(np.ptp(local, axis=0)) / MOST_CELLS) ** (1 / 3)
        cell = self.spacing or max(tolerance, spacing, least)
        cloud, *_ = thinned(local, 0.7 * cell)
        if len(cloud) < FEWEST:
            raise StageError(
                f"{len(points)} points, {len(cloud)} after thinning, are too few for a surface",
                "a smaller spacing, or method: implicit",
            )
        count = min(self.neighbours, len(cloud) // 2)
        cloud, _, _ = smoothed(cloud, noise, min(max(count, SMOOTHED), len(cloud) // 2))
        mesh = pyvista.PolyData(cloud).reconstruct_surface(nbr_sz=count, sample_spacing=cell)
        if not mesh.n_cells:
            raise StageError("no surface came about", "another spacing, or method: implicit")
        mesh = mesh.triangulate().clean()
        vertices, faces = np.asarray(mesh.points, np.float64), mesh.regular_faces.astype(np.int64)
        # The filter's level goes on beyond the data; what no point vouches for is cut away.
        near = np.asarray(cKDTree(cloud).query(vertices, workers=2)[0]) < 1.4 * cell
        # Where it overshoots the part it bounds no lost material, and a background close to the part would not hold it.
        near &= signed_distance(vertices @ axes.T + origin, part)[0] < 0.5 * tolerance
        faces = _largest(faces[near[faces].all(axis=1)])
        if not len(faces):
            raise StageError("no surface came about", "another spacing, or method: implicit")
        used, faces = np.unique(faces, return_inverse=True)
        surface = Surface(vertices[used] @ axes.T + origin, faces.reshape(-1, 3))
        return surface if _toward_skin(surface, part) else Surface(surface.vertices, surface.faces[:, ::-1])


def _largest(faces: Ints) -> Ints:
    """The largest piece whose triangles hang together by edges, without corners where two rims touch."""
    import trimesh

    while len(faces):
        pairs = trimesh.graph.face_adjacency(faces)
        label = trimesh.graph.connected_component_labels(pairs, node_count=len(faces))
        faces = faces[label == np.bincount(label).argmax()]
        edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        _, inverse, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
        starts, often = np.unique(edges[counts[inverse.reshape(-1)] == 1][:, 0], return_counts=True)
        if often.max(initial=0) <= 1 and counts.max() <= 2:
            break
        bad = np.union1d(starts[often > 1], edges[counts[inverse.reshape(-1)] > 2])
        faces = faces[~np.isin(faces, bad).any(axis=1)]
    return faces


def _toward_skin(surface: Surface, part: Part) -> bool:
    """Whether the normals point to the nominal skin nearest to them, by area."""
    import igl

    origin = part.bounds.mean(axis=0)
    middle = np.ascontiguousarray(surface.triangles.mean(axis=1) - origin)
    _, _, closest = igl.point_mesh_squared_distance(
        middle, np.ascontiguousarray(part.vertices - origin), np.array(part.faces)
    )
    return float(np.einsum("ij,ij->", surface.cross, closest - middle)) >= 0
