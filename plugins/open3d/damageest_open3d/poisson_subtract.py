"""Poisson reconstruction of the whole scan, and the part minus that body."""

from __future__ import annotations

from typing import Any, ClassVar, Literal

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
    Scan,
    Sites,
)
from damageest.errors import StageError
from damageest.stages.enclose import EncloseAll

FEWEST = 100
"""Fewest points for a body; Open3D crashes on very few points."""
THINNEST = 1e-6
"""Least spread of the points across their flattest direction, in diagonals of the part; Open3D crashes on less."""
NEIGHBOURS = 30
"""Points of each normal's fit."""
INTACT_WEIGHT = 100.0
"""Weight of the nearest face's normal at an intact point; at a damaged one it is 1, because the nearest face may be on
the other side of the part."""
MARGIN = 0.1
"""Distance from the part to the box round it, in diagonals of the part."""


class PoissonSubtract(EncloseAll):
    """The part minus a screened Poisson body of the whole scan (Kazhdan and Hoppe 2013), by Open3D. For comparison.

    The difference has slivers: wherever noise or a rounded edge puts the body below intact skin.
    """

    isolated: ClassVar[bool] = True
    use: Literal["poisson_subtract"] = "poisson_subtract"
    depth: int = Field(
        9, ge=5, le=13, description="most levels of the octree over the scan; it gets no finer than the points"
    )
    scale: float = Field(1.1, gt=1, le=4, description="edge of the octree's cube, in edges of the scan's bounding cube")

    def run(self, part: Part, aligned: Scan, deviation: Deviation, sites: Sites, tolerance: float) -> Enclosures:
        """Raises StageError where the scan has too few points, where no closed body can be reconstructed, or where no
        part of the metal is outside it."""
        from manifold3d import Manifold

        from damageest.geometry.bodies import split_bodies
        from damageest.geometry.pieces import find_pieces
        from damageest.geometry.solids import to_manifold, to_solid

        if not sites.count:
            return Enclosures(())
        intact = np.isin(deviation.label, (INTACT, ADDED))
        members = sites.label > 0
        used = intact | members
        # Open3D computes in single precision: coordinates near the origin, of size one, lose least.
        origin, size = part.bounds.mean(axis=0), part.diagonal
        points = (aligned.points[used] - origin) / size
        if len(points) < FEWEST or np.linalg.eigvalsh(np.cov(points.T))[0] < THINNEST**2:
            raise StageError(
                f"no closed body can be reconstructed from {len(points)} points that are too few or lie in one plane",
                "a denser scan",
                method="implicit",
            )
        cell = max(tolerance, aligned.spacing) / size
        above = _compute_face_normals(part)[deviation.face[used]] * np.where(intact, INTACT_WEIGHT, 1.0)[used, None]
        vertices, faces = _reconstruct_body(points, above, cell, self.depth, self.scale)
        mesh, notes = _keep_closed(vertices * size, faces)
        try:
            # Edges where the body touches itself are separated here; no vertex moves.
            body = to_manifold(mesh)
        except ValueError as error:
            raise StageError(
                f"the Poisson body is not usable: {error}", "another enclose.depth", method="implicit"
            ) from None
        if body.volume() <= 0:
            raise StageError("the Poisson body is inside out", "a scan of all sides", method="implicit")
        nominal = to_manifold(part, origin)
        lost = to_solid(nominal - body, origin)
        low, high = part.bounds - origin + MARGIN * size * np.array([[-1.0], [1.0]])
        around = to_solid(Manifold.cube(tuple(high - low)).translate(tuple(low)) - body, origin)
        if lost is None or around is None:
            raise StageError("no metal of the part is outside the Poisson body", method="implicit")
        # By the rule by which the route drops pieces, so that the note counts what the route drops.
        reach = max(2 * tolerance, aligned.spacing)
        kept, dropped = find_pieces(lost, aligned.points[members], sites.label[members].astype(np.int64), reach)
        count = len(split_bodies(lost))
        if slivers := count - len(kept):
            notes += (
                f"{slivers} of the {count} pieces of part minus body touch no damaged point: slivers, "
                f"{dropped / lost.volume:.1%} of the volume; slivers that are connected to the damage are not counted",
            )
        return Enclosures((Enclosure(around, tuple(range(1, sites.count + 1)), notes),))


def _compute_face_normals(part: Part) -> Floats:
    """(F,3) unit normals of the faces."""
    return part.face_normals


def _reconstruct_body(points: Floats, above: Floats, cell: float, depth: int, scale: float) -> tuple[Floats, Ints]:
    """Vertices (V,3) and faces (F,3) of the Poisson surface of points (N,3). Normals are oriented outward by ``above``
    (N,3), the weighted normals of the nearest faces, and so that they agree with their neighbours."""
    from damageest.geometry.orientation import HINT, turn_toward_void
    from damageest_open3d._system import check

    check()
    import open3d as o3d

    cloud: Any = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamKNN(NEIGHBOURS))
    nothing = np.empty((0, 3))
    normals = turn_toward_void(points, np.asarray(cloud.normals), HINT * above, nothing, nothing, np.empty(0), cell)
    cloud.normals = o3d.utility.Vector3dVector(normals)
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        try:
            # With several threads the sums differ from run to run.
            mesh, _ = o3d.geometry.TriangleMesh.create_from_point_cloud_poisson(
                cloud, depth=depth, scale=scale, n_threads=1
            )
        except RuntimeError as error:
            raise StageError(
                f"Open3D could not reconstruct a surface: {str(error).strip()}",
                "another enclose.depth",
                method="implicit",
            ) from None
    return np.asarray(mesh.vertices).copy(), np.asarray(mesh.triangles).astype(np.int64)


def _keep_closed(vertices: Floats, faces: Ints) -> tuple[Mesh, tuple[str, ...]]:
    """The closed components of a mesh (V,3), (F,3), and notes on the others.

    Raises StageError where the largest component is open.
    """
    from damageest.geometry.bodies import label_pieces

    if not len(faces):
        raise StageError("no Poisson body could be reconstructed", "a denser scan", method="implicit")
    owner = label_pieces(faces)
    unpaired, crowded = _count_flawed_edges(faces)
    loose = np.bincount(owner, unpaired)
    largest = int(np.argmax(np.bincount(owner)))
    if loose[largest]:
        raise StageError(
            f"the Poisson body is not watertight: {int(loose[largest])} of its edges have a triangle on one side "
            "only, as when one side of the part has no scan points",
            "a scan of all sides, or a larger enclose.scale",
            method="implicit",
        )
    notes = []
    if sheets := int((loose > 0).sum()):
        notes.append(f"{sheets} open sheets beside the Poisson body were left out")
    if sheets + 1 < len(loose):
        notes.append(f"the Poisson body consists of {len(loose) - sheets} closed surfaces")
    kept = loose[owner] == 0
    if touching := int(crowded[kept].sum()) // 4:
        notes.append(f"the Poisson body is not manifold: it touches itself along {touching} edges")
    used, inverse = np.unique(faces[kept], return_inverse=True)
    return Mesh(vertices[used], inverse.reshape(-1, 3)), tuple(notes)


def _count_flawed_edges(faces: Ints) -> tuple[Ints, Ints]:
    """For each face (F,) how many of its edges lack an opposite edge, and how many are shared by four or more faces."""
    first, second = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    size = int(faces.max()) + 1
    codes, inverse, counts = np.unique(first * size + second, return_inverse=True, return_counts=True)
    back = codes % size * size + codes // size
    at = np.searchsorted(codes, back).clip(max=len(codes) - 1)
    opposite = np.where(codes[at] == back, counts[at], 0)
    of_edge = np.stack([counts != opposite, (counts == opposite) & (counts > 1)])[:, inverse]
    unpaired, crowded = of_edge.reshape(2, -1, 3).sum(axis=2)
    return unpaired, crowded
