"""Faces of planes, cylinders and spheres through an inner damage surface that is made of them.

Each face reaches a little beyond its share of the surface. Where several meet, they are intersected with one another,
and what hangs over beyond their common edges is left out. Lengths are the mesh's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints, Mesh
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.vectors import cross_corners
from damageest_cadquery.solids.split import Tool
from damageest_cadquery.surfaces._outlines import cover, trace_regions
from damageest_cadquery.surfaces._recognise import Shape, recognise

LEFT = 0.12
"""Largest share of the surface that may lie off all recognised faces, as the rounding of edges and rims does."""
SLIVER = 0.03
"""Share of the surface below which a recognised face is taken for a piece of a rounding."""
_WRAP = 2 * np.pi


@dataclass(frozen=True, eq=False)
class Found:
    """What a surface is made of. ``label`` (F,): for each triangle the number of its shape in ``shapes``, -1 for none;
    ``nearest`` (F,): of the nearest one. ``whole``: whether they explain all of it but the roundings of its edges."""

    shapes: Sequence[Shape]
    label: Ints
    nearest: Ints
    whole: bool


def find_shapes(inner: Mesh, tolerance: float) -> Found:
    """The shapes that a surface is made of, wholly or in part."""
    shapes, label = recognise(inner, tolerance / 5, LEFT)
    area = 2 * inner.face_areas
    area /= area.sum()
    sizes = np.array([area[label == k].sum() for k in range(len(shapes))])
    # slivers of the roundings at edges and rims are recognised too: what a larger shape explains almost as well goes
    real = [k for k in range(len(shapes)) if sizes[k] > SLIVER]
    if not real:
        none = np.full(len(area), -1)
        return Found((), none, none, False)
    centres = inner.triangles.mean(axis=1)
    off = np.abs(np.stack([shapes[k].measure(centres)[0] for k in real]))
    keep = (label >= 0) & np.isin(label, real)
    nearest = np.where(keep, np.searchsorted(real, np.where(keep, label, real[0])), off.argmin(axis=0))
    own = np.where(keep | (off.min(axis=0) <= tolerance / 2), nearest, -1)
    return Found([shapes[k] for k in real], own, nearest, bool(area[label < 0].sum() < LEFT))


def build_shapes(inner: Mesh, shapes: Sequence[Shape], label: Ints, tolerance: float, beyond: float) -> Tool | None:
    """Faces of recognised shapes, each trimmed by the others."""
    faces: list[Any] = []
    for number, shape in enumerate(shapes):
        corners = inner.triangles[label == number]
        face = _build_shape(shape, corners, beyond)
        if face is None:
            return None
        faces.append(face)
    return Tool(faces, faces[0]) if len(faces) == 1 else _trim_by_others(faces, inner, label, tolerance)


def _build_shape(shape: Shape, corners: Floats, beyond: float) -> Any:
    """A face of a plane, cylinder or sphere round triangles ``corners`` (F,3,3)."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.gp import gp_Ax3, gp_Cylinder, gp_Dir, gp_Pln, gp_Pnt, gp_Sphere

    def place(axis: Floats, across: Floats) -> Any:
        return gp_Ax3(gp_Pnt(*shape.point.tolist()), gp_Dir(*axis.tolist()), gp_Dir(*across.tolist()))

    first = np.linalg.svd(shape.axis[None])[2][1]
    if shape.kind == "plane":
        second = np.cross(shape.axis, first)
        flat = np.stack([(corners - shape.point) @ first, (corners - shape.point) @ second], axis=-1)
        outline = _trace_outline(flat, beyond)
        plane = gp_Pln(place(shape.axis, first))
        maker = BRepBuilderAPI_MakeFace(plane, _polygon(outline[0], shape.point, first, second), True)
        for rim in outline[1:]:
            maker.Add(_polygon(rim, shape.point, first, second))
        return maker.Face()
    if shape.kind == "sphere":
        return BRepBuilderAPI_MakeFace(gp_Sphere(place(shape.axis, first), shape.radius)).Face()
    along = (corners - shape.point) @ shape.axis
    low, high = float(along.min()) - beyond, float(along.max()) + beyond
    second = np.cross(shape.axis, first)
    angles = np.arctan2((corners - shape.point) @ second, (corners - shape.point) @ first).ravel()
    ordered = np.sort(angles)
    gaps = np.diff(np.append(ordered, ordered[0] + _WRAP))
    widest = int(gaps.argmax())
    if gaps[widest] * shape.radius < 3 * beyond:
        return BRepBuilderAPI_MakeFace(
            gp_Cylinder(place(shape.axis, first), shape.radius), 0.0, _WRAP, low, high
        ).Face()
    start = ordered[(widest + 1) % len(ordered)]
    span = _WRAP - gaps[widest] + 2 * beyond / shape.radius
    turn = start - beyond / shape.radius
    across = np.cos(turn) * first + np.sin(turn) * second
    return BRepBuilderAPI_MakeFace(gp_Cylinder(place(shape.axis, across), shape.radius), 0.0, span, low, high).Face()


def _polygon(rim: Floats, origin: Floats, first: Floats, second: Floats) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakePolygon
    from OCP.gp import gp_Pnt

    maker = BRepBuilderAPI_MakePolygon()
    for point in (origin + rim[:, :1] * first + rim[:, 1:] * second).tolist():
        maker.Add(gp_Pnt(*point))
    maker.Close()
    return maker.Wire()


def _trace_outline(triangles: Floats, beyond: float) -> list[Floats]:
    """The outlines (K,2) of all regions of triangles (F,3,2), moved outward by ``beyond``, the longest first."""
    loops = [loop for region in trace_regions(cover(triangles)[0], beyond) for loop in region]
    return sorted(loops, key=lambda loop: -np.ptp(loop, axis=0).prod())


def _trim_by_others(faces: list[Any], inner: Mesh, label: Ints, tolerance: float) -> Tool | None:
    """Splits faces by one another and drops the pieces that hang over beyond a common edge."""
    from OCP.BRep import BRep_Builder
    from OCP.BRepAlgoAPI import BRepAlgoAPI_BuilderAlgo
    from OCP.TopoDS import TopoDS, TopoDS_Compound
    from OCP.TopTools import TopTools_ListOfShape

    arguments = TopTools_ListOfShape()
    for face in faces:
        arguments.Append(face)
    algorithm = BRepAlgoAPI_BuilderAlgo()
    algorithm.SetArguments(arguments)
    algorithm.SetRunParallel(False)
    algorithm.Build()
    if not algorithm.IsDone():
        return None
    builder, shape = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(shape)
    kept = []
    for number, face in enumerate(faces):
        for piece in list(algorithm.Modified(face)) or [face]:
            points, areas = _sample_face(piece, tolerance)
            if not len(points):
                continue
            off, nearest, _ = closest_on_mesh(points, inner)
            good = (off < tolerance / 3) & (label[nearest] == number)
            if areas[good].sum() < 0.35 * areas[off < tolerance].sum() or not good.any():
                continue
            piece = TopoDS.Face_s(piece)
            builder.Add(shape, piece)
            kept.append(piece)
    return Tool(kept, shape) if kept else None


def _sample_face(face: Any, size: float) -> tuple[Floats, Floats]:
    """Points (N,3) spread over a face, with their areas (N,)."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    face = TopoDS.Face_s(face)
    BRepMesh_IncrementalMesh(face, size / 5, False, 0.3, False)
    mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
    if mesh is None:
        return np.empty((0, 3)), np.empty(0)
    points = np.array([mesh.Node(i).Coord() for i in range(1, mesh.NbNodes() + 1)])
    triangles = np.array([mesh.Triangle(i).Get() for i in range(1, mesh.NbTriangles() + 1)], np.int64) - 1
    return subdivide(points[triangles], size / 2)


def subdivide(corners: Floats, size: float) -> tuple[Floats, Floats]:
    """Points (N,3) on triangles (F,3,3), about ``size`` apart, with their areas (N,)."""
    areas = np.linalg.norm(cross_corners(corners), axis=1) / 2
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
    steps = np.clip(np.ceil(longest / size), 1, 40).astype(int)
    points, weights = [], []
    for step in np.unique(steps):
        here = corners[steps == step]
        i, j = np.meshgrid(np.arange(step), np.arange(step), indexing="ij")
        up = (i + j < step)[..., None] * [1]
        a = np.stack([(i + 1 / 3) / step, (j + 1 / 3) / step], -1)[up[..., 0] > 0]
        down = i + j < step - 1
        b = np.stack([(i + 2 / 3) / step, (j + 2 / 3) / step], -1)[down]
        uv = np.concatenate([a, b])
        weight = np.column_stack([1 - uv.sum(1), uv])
        points.append(np.einsum("pk,fkj->fpj", weight, here).reshape(-1, 3))
        weights.append(np.repeat(areas[steps == step] / step**2, len(uv)))
    return np.concatenate(points), np.concatenate(weights)
