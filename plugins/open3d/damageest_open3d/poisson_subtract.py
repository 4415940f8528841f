"""Poisson reconstruction of the whole scan, and the part minus it."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydantic import Field

from damageest.artefacts import (
    ADDED,
    INTACT,
    Deviation,
    Enclosure,
    Enclosures,
    Floats,
    Ints,
    Mesh,
    Part,
    Samples,
    Scan,
    Sites,
    Solid,
)
from damageest.errors import StageError
from damageest.stages.enclose import EncloseAll

FEWEST = 100
"""Points below which there is no body to speak of; Open3D crashes on very few."""
FLAT = 1e-6
"""Least spread across the points, in diagonals of the part; Open3D crashes on points in one place."""
NEIGHBOURS = 30
"""Points of each normal's fit."""
FIRM = 100.0
"""How much more the nearest face says about the side of a sound point than about that of a damaged one, whose nearest
face may be the one behind it."""
CLEAR = 0.1
"""From the part to the box round it, in diagonals of the part."""


class PoissonSubtract(EncloseAll):
    """Screened Poisson (Kazhdan and Hoppe 2013) of the whole scan, by Open3D, and the part minus that body, slivers
    included: wherever noise or a rounded edge leaves the body below sound skin. For comparison."""

    use: Literal["poisson_subtract"] = "poisson_subtract"
    depth: int = Field(
        9, ge=5, le=13, description="levels of the octree over the scan, at most: it goes no finer than the points"
    )
    scale: float = Field(1.1, gt=1, le=4, description="edge of the octree's cube, in edges of the scan's bounding cube")

    def run(
        self, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, samples: Samples, tolerance: float
    ) -> Enclosures:
        """Raises StageError where the scan says too little, no closed body comes about, or nothing of the part is
        outside it."""
        from manifold3d import Manifold

        from damageest.geometry.pieces import find_pieces
        from damageest.geometry.solids import to_manifold, to_solid

        if not sites.count:
            return Enclosures(())
        sound = np.isin(deviation.label, (INTACT, ADDED))
        members = sites.label > 0
        used = sound | members
        # On coordinates of size one about the middle, Open3D's single precision loses nothing.
        origin, size = part.bounds.mean(axis=0), part.diagonal
        points = (aligned.points[used] - origin) / size
        if len(points) < FEWEST or np.linalg.eigvalsh(np.cov(points.T))[0] < FLAT**2:
            raise StageError(
                f"{len(points)} points, or points in one plane, bound no body", "method: implicit, or a denser scan"
            )
        cell = max(tolerance, aligned.spacing) / size
        above = _face_normals(part)[deviation.face[used]] * np.where(sound, FIRM, 1.0)[used, None]
        vertices, faces = _poisson(points, above, cell, self.depth, self.scale)
        mesh, notes = _closed(vertices * size, faces)
        try:
            # edges where the body touches itself come apart here, and nothing moves
            body = to_manifold(mesh)
        except ValueError as error:
            raise StageError(f"the Poisson body: {error}", "another enclose.depth, or method: implicit") from None
        if body.volume() <= 0:
            raise StageError("the Poisson body is inside out", "method: implicit, or a scan of all sides")
        nominal = to_manifold(part, origin)
        gone = to_solid(nominal - body, origin)
        low, high = part.bounds - origin + CLEAR * size * np.array([[-1.0], [1.0]])
        around = to_solid(Manifold.cube(tuple(high - low)).translate(tuple(low)) - body, origin)
        if gone is None or around is None:
            raise StageError("nothing of the part is outside the Poisson body", "method: implicit")
        # the rule by which the route drops pieces, so that the note counts what it will drop
        reach = max(2 * tolerance, aligned.spacing)
        kept, dropped = find_pieces(gone, aligned.points[members], sites.label[members].astype(np.int64), reach)
        count = _pieces(gone)
        if slivers := count - len(kept):
            notes += (
                f"{slivers} of the {count} pieces of part minus body touch no damaged point: slivers, "
                f"{dropped / gone.volume:.1%} of the volume, not counting those that a thin neck joins to the damage",
            )
        return Enclosures((Enclosure(around, tuple(range(1, sites.count + 1)), notes),))


def _face_normals(part: Part) -> Floats:
    """(F,3) unit normals."""
    return np.asarray(part.cross / np.maximum(np.linalg.norm(part.cross, axis=1), 1e-300)[:, None])


def _poisson(points: Floats, above: Floats, cell: float, depth: int, scale: float) -> tuple[Floats, Ints]:
    """The mesh (V,3), (F,3) of points (N,3), whose normals turn outward by ``above`` (N,3) and by one another."""
    from damageest.geometry.orientation import turn_toward_void
    from damageest_open3d._system import check

    check()
    import open3d as o3d

    cloud: Any = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    nothing = np.empty((0, 3))
    normals = turn_toward_void(points, np.asarray(cloud.normals), above, nothing, nothing, np.empty(0), cell)
    cloud.normals = o3d.utility.Vector3dVector(normals)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            # with several threads the sums differ from run to run
            mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
                cloud, depth=depth, scale=scale, n_threads=1
            )
        except RuntimeError as error:
            raise StageError(
                f"Open3D could not reconstruct: {str(error).strip()}", "another enclose.depth, or method: implicit"
            ) from None
    return np.asarray(mesh.vertices).copy(), np.asarray(mesh.triangles).astype(np.int64)


def _closed(vertices: Floats, faces: Ints) -> tuple[Mesh, tuple[str, ...]]:
    """The closed ones of a mesh's components (V,3), (F,3), and what to say of them.

    Raises StageError where the largest of them is open.
    """
    if not len(faces):
        raise StageError("no Poisson body came about", "method: implicit, or a denser scan")
    owner = _owners(faces)
    lone, crowded = _edges(faces)
    loose = np.bincount(owner, lone)
    largest = int(np.argmax(np.bincount(owner)))
    if loose[largest]:
        raise StageError(
            f"the Poisson body is not watertight: {int(loose[largest])} of its edges have a triangle on one side "
            "alone, as where the scan has a side without points",
            "method: implicit, a scan of all sides, or more enclose.scale",
        )
    notes = []
    if sheets := int((loose > 0).sum()):
        notes.append(f"{sheets} open sheets beside the Poisson body were left out")
    if sheets + 1 < len(loose):
        notes.append(f"the Poisson body came out in {len(loose) - sheets} closed surfaces")
    kept = loose[owner] == 0
    if touching := int(crowded[kept].sum()) // 4:
        notes.append(f"the Poisson body is not manifold: it touches itself along {touching} edges")
    used, inverse = np.unique(faces[kept], return_inverse=True)
    return Mesh(vertices[used], inverse.reshape(-1, 3)), tuple(notes)


def _edges(faces: Ints) -> tuple[Ints, Ints]:
    """For each face (F,3) how many of its edges are not passed as often the other way, and how many several times."""
    first, second = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    size = int(faces.max()) + 1
    codes, inverse, counts = np.unique(first * size + second, return_inverse=True, return_counts=True)
    back = codes % size * size + codes // size
    at = np.searchsorted(codes, back).clip(max=len(codes) - 1)
    opposite = np.where(codes[at] == back, counts[at], 0)
    of_edge = np.stack([counts != opposite, (counts == opposite) & (counts > 1)])[:, inverse]
    lone, crowded = of_edge.reshape(2, -1, 3).sum(axis=2)
    return lone, crowded


def _owners(faces: Ints) -> Ints:
    """The connected component (F,) of each face (F,3)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    first, second = faces[:, [0, 1, 1, 2]].reshape(-1, 2).T
    links = coo_array((np.ones(len(first)), (first, second)), shape=(int(faces.max()) + 1,) * 2)
    return np.asarray(connected_components(links, directed=False)[1][faces[:, 0]])


def _pieces(solid: Solid) -> int:
    """How many separate pieces a solid has; a cavity in one is none."""
    a, b, c = np.moveaxis(solid.triangles - solid.bounds.mean(axis=0), 1, 0)
    volume = np.bincount(_owners(solid.faces), np.einsum("ij,ij->i", a, np.cross(b, c)))
    return int((volume > 0).sum())
