"""Checks an exact damage volume against the mesh and the scan before it is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Part, Solid, Surface
from damageest.geometry.distance import closest_on_mesh, distance_to_mesh
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.face_measures import is_plane, measure_area
from damageest_cadquery.solids.split import Piece, find_corners, measure_volume
from damageest_cadquery.surfaces.recognised import subdivide

INVALID = "not valid (BRepCheck)"
VOLUME = 0.003
"""Largest relative difference of the volumes, beside what the triangles of the part cut off its curved faces."""
LIMITS = {"shapes": (0.1, 2.0), "planes": (0.1, 2.0), "spline": (0.02, 1.5), "facets": (0.01, 1.0)}
"""By form: the share of the inner surface that may be farther than a quarter of the tolerance, and how far it may be,
in tolerances. Where recognised faces meet, the mesh rounds their edge; there the scan decides which is right."""
STRAY = 0.01
"""Share of the inner faces' area that the cut may have elsewhere in the part."""
ON_CAD = 1e-6
"""Largest distance of outer corners from the CAD's surfaces, in diagonals of the part."""


@dataclass(frozen=True)
class Measured:
    """``volume``; ``distance``: 95 % of the inner surface are as near to the mesh's, both ways; ``farthest``: all of
    it; ``beyond``: the share of it that is farther than a quarter of the tolerance. What lies less than that below the
    skin is near, since no surface is known there. ``off_cad``: of outer corners from the CAD's surfaces. ``reason``:
    why the solid is refused, empty where it is not."""

    volume: float
    reason: str = ""
    distance: float = np.nan
    farthest: float = np.nan
    beyond: float = np.nan
    off_cad: float = np.nan


@dataclass(frozen=True, eq=False)
class Target:
    """What an exact damage volume has to agree with, in the part's frame and the job's unit.

    The ``damage`` volume as a mesh, its inner ``surface``, the scan ``points`` (N,3) on that; the ``part``, its
    ``cad_faces`` by number, and how far their own corners may lie off them (``off_faces``).
    """

    damage: Solid
    surface: Surface
    points: Floats
    part: Part
    tolerance: float
    cad_faces: Sequence[Any]
    off_faces: float = 0.0


def check_pieces(form: str, pieces: Sequence[Piece], cut_off: float, bodies: int, target: Target) -> Measured:
    """Measures the pieces of a damage volume.

    ``cut_off``: area of new faces on what is left of the part; ``bodies``: how many solids are expected.
    """
    from OCP.BRep import BRep_Tool
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    damage, surface, part, tolerance = target.damage, target.surface, target.part, target.tolerance
    volume = sum(measure_volume(piece.shape) for piece in pieces)

    def refuse(reason: str, *numbers: float) -> Measured:
        return Measured(volume, reason, *numbers)

    if not all(BRepCheck_Analyzer(piece.shape).IsValid() for piece in pieces):
        return refuse(INVALID)
    shells = [shell for piece in pieces for shell in explore(piece.shape, TopAbs_SHELL)]
    if not all(BRep_Tool.IsClosed_s(TopoDS.Shell_s(shell)) for shell in shells):
        return refuse("not closed")
    if len(pieces) != bodies:
        return refuse(f"{len(pieces)} solids for {bodies} pieces")
    if cut_off > (1 + STRAY) * measure_inner_area(pieces):
        return refuse("it cuts into the part elsewhere too")
    faces = [
        (TopoDS.Face_s(face), origin)
        for piece in pieces
        for face, origin in zip(explore(piece.shape, TopAbs_FACE), piece.origins, strict=True)
    ]
    if any(origin == (-1, -1) for _, origin in faces):
        return refuse("faces of unknown origin")
    curved = sum(measure_area(face) for face, (number, _) in faces if number >= 0 and not is_plane(face))
    room = VOLUME * damage.volume + part.tessellation_error * curved
    if abs(volume - damage.volume) > room:
        return refuse(f"its volume differs by {volume / damage.volume - 1:+.2%}")
    inner = mesh_faces([face for face, (_, tool) in faces if tool >= 0])
    there = np.minimum(distance_to_mesh(surface.vertices, inner), distance_to_mesh(surface.vertices, part))
    spread, areas = subdivide(inner.triangles, tolerance / 2)
    back = np.minimum(distance_to_mesh(spread, surface), distance_to_mesh(spread, part))
    weights = np.linalg.norm(surface.vertex_cross, axis=1)
    weights, areas = weights / weights.sum(), areas / areas.sum()
    quarter = tolerance / 4
    beyond = max(float(weights[there > quarter].sum()), float(areas[back > quarter].sum()))
    pairs = ((there, weights), (back, areas))
    distance = max(float(np.quantile(one, 0.95, weights=own, method="inverted_cdf")) for one, own in pairs)
    farthest = max(float(there.max()), float(back.max()))
    near, cad = ON_CAD * part.diagonal + target.off_faces, target.cad_faces
    off = max((_measure_off(face, cad[number], near) for face, (number, _) in faces if number >= 0), default=0.0)
    numbers = (distance, farthest, beyond, off)
    if off > near:
        return refuse(f"an outer corner lies {off / tolerance:.2g} tolerances off the CAD's surface", *numbers)
    share, most = LIMITS[form]
    if farthest > most * tolerance or beyond > share:
        return refuse(
            f"up to {farthest / tolerance:.2g} tolerances from the mesh, on {beyond:.1%} more than a quarter", *numbers
        )
    if beyond > 0.01 and not _is_nearer(target.points, inner, surface, quarter):
        return refuse("the scan's points are nearer to the mesh", *numbers)
    return Measured(volume, "", *numbers)


def measure_inner_area(pieces: Sequence[Piece]) -> float:
    """The area of the faces that do not come from the part's CAD faces."""
    from OCP.TopAbs import TopAbs_FACE

    return sum(
        measure_area(face)
        for piece in pieces
        for face, (_, tool) in zip(explore(piece.shape, TopAbs_FACE), piece.origins, strict=True)
        if tool >= 0
    )


def _is_nearer(points: Floats, inner: Mesh, surface: Surface, quarter: float) -> bool:
    """Whether the scan's points, where exact form and mesh differ, lie as near to the exact form."""
    exact, _, foot = closest_on_mesh(points, inner)
    meshed, _, other = closest_on_mesh(points, surface)
    apart = (np.linalg.norm(foot - other, axis=1) > quarter) & (np.minimum(exact, meshed) < 8 * quarter)
    if apart.sum() < 10:
        return True
    return bool(np.sqrt(np.mean(exact[apart] ** 2)) <= 1.1 * np.sqrt(np.mean(meshed[apart] ** 2)))


def mesh_faces(faces: Sequence[Any]) -> Mesh:
    """The triangles of faces that the mesher has divided already."""
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    points, triangles, count = [], [], 0
    for face in faces:
        mesh = BRep_Tool.Triangulation_s(TopoDS.Face_s(face), TopLoc_Location())
        if mesh is None:
            continue
        points.append(np.array([mesh.Node(i).Coord() for i in range(1, mesh.NbNodes() + 1)]))
        rows = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], np.int64).reshape(-1, 3)
        triangles.append(rows - 1 + count)
        count += len(points[-1])
    return Mesh(np.concatenate(points), np.concatenate(triangles))


def _measure_off(face: Any, original: Any, near: float) -> float:
    """The largest distance of a face's corners from the face that it is a piece of. In files of little precision the
    part's own edges lie farther off its surfaces than ``near``; so a corner that does, but lies on such an edge, counts
    by its distance from that edge."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
    from OCP.BRepExtrema import BRepExtrema_DistShapeShape
    from OCP.gp import gp_Pnt
    from OCP.ShapeAnalysis import ShapeAnalysis_Surface
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopoDS import TopoDS

    analysis = ShapeAnalysis_Surface(BRep_Tool.Surface_s(TopoDS.Face_s(original)))
    edges, off = explore(original, TopAbs_EDGE), 0.0
    for point in find_corners(face).tolist():
        analysis.ValueOfUV(gp_Pnt(*point), 1e-7)
        gap = float(analysis.Gap())
        if gap > near:
            corner = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
            gap = min(gap, *(BRepExtrema_DistShapeShape(corner, edge).Value() for edge in edges))
        off = max(off, gap)
    return off
