"""Solids of stock: turned outward, joined, and what cannot be made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_cadquery._read import explore
from damageest_cadquery._split import ShapeMap, measure_volume

SEWN = 2e-5
"""Distance in millimetres within which edges of faces are one edge, where they do not claim to be less exact."""


class StockError(Exception):
    """The stock cannot be made of offsets of CAD faces; the message says why."""


def orient_solid(shape: Any) -> Any:
    """The one solid of a shape with its faces outward. Raises StockError where it is not sound."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepLib import BRepLib
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    solids = explore(_place_faces(shape), TopAbs_SOLID)
    if len(solids) != 1:
        raise StockError("the offset of a face is not one solid")
    solid = TopoDS.Solid_s(solids[0])
    BRepLib.OrientClosedSolid_s(solid)
    if not BRepCheck_Analyzer(solid).IsValid() or measure_volume(solid) <= 0:
        raise StockError("the offset of a face folds")
    return solid


def _place_faces(shape: Any) -> Any:
    """The shape with faces in their own place: faces that are others moved, as in a prism, have no names in STEP."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
    from OCP.TopLoc import TopLoc_Location

    faces = explore_faces(shape)
    if all(face.Location().IsIdentity() for face in faces):
        return shape
    placed = []
    for face in faces:
        if not face.Location().IsIdentity():
            move = face.Location().Transformation()
            face = BRepBuilderAPI_Transform(face.Located(TopLoc_Location()), move, True).Shape()
        placed.append(face)
    return close(placed)


def close(faces: Sequence[Any]) -> Any:
    """The solid that faces bound. Raises StockError where they leave a gap."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid
    from OCP.TopAbs import TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    for distance in _list_distances(faces):
        shells = [TopoDS.Shell_s(shell) for shell in explore(_sew_faces(faces, distance).SewedShape(), TopAbs_SHELL)]
        if len(shells) == 1 and BRep_Tool.IsClosed_s(shells[0]):
            return BRepBuilderAPI_MakeSolid(shells[0]).Solid()
    raise StockError("the offset of a face and its sides do not close")


def _sew_faces(faces: Sequence[Any], distance: float) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing

    sewing = BRepBuilderAPI_Sewing(distance)
    for face in faces:
        sewing.Add(face)
    sewing.Perform()
    return sewing


def _list_distances(faces: Sequence[Any]) -> list[float]:
    """The distances, in millimetres, within which edges of faces are tried as one: a curve where two splines meet lies
    on each of them only within the edge's own tolerance, and what is built on it is no nearer."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopoDS import TopoDS

    edges = (TopoDS.Edge_s(edge) for face in faces for edge in explore(face, TopAbs_EDGE))
    claimed = 2 * max((BRep_Tool.Tolerance_s(edge) for edge in edges), default=0.0)
    return [SEWN] if claimed <= SEWN else [SEWN, claimed]


def combine(algorithm: Any, arguments: Sequence[Any], tools: Sequence[Any], fuzzy: float = 1e-6) -> Any:
    """The shape that a Boolean operation gives. Raises StockError where OpenCASCADE reports an error, and for offsets
    of splines, with which it takes a minute."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_OffsetSurface
    from OCP.TopTools import TopTools_ListOfShape

    kinds = {BRepAdaptor_Surface(face).GetType() for shape in (*arguments, *tools) for face in explore_faces(shape)}
    if GeomAbs_OffsetSurface in kinds:
        raise StockError("the offset of a spline meets other stock, or metal that is left")

    lists = TopTools_ListOfShape(), TopTools_ListOfShape()
    for chosen, shapes in zip(lists, (arguments, tools), strict=True):
        for shape in shapes:
            chosen.Append(shape)
    algorithm.SetArguments(lists[0])
    algorithm.SetTools(lists[1])
    algorithm.SetRunParallel(False)
    algorithm.SetNonDestructive(True)
    algorithm.SetFuzzyValue(fuzzy)
    algorithm.Build()
    if not algorithm.IsDone():
        raise StockError("OpenCASCADE cannot join the stock")
    return algorithm.Shape()


def explore_faces(shape: Any) -> list[Any]:
    """The faces of a shape."""
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopoDS import TopoDS

    return [TopoDS.Face_s(face) for face in explore(shape, TopAbs_FACE)]


def sew(solids: Sequence[Any]) -> tuple[list[Any], ShapeMap] | None:
    """Solids that touch on whole faces, joined without these; and for each new face the solid and the face that it was.

    None where the rest does not close.
    """
    faces = [(number, k, face) for number, solid in enumerate(solids) for k, face in enumerate(explore_faces(solid))]
    for distance in _list_distances([face for _, _, face in faces]):
        inside = _find_twins([face for _, _, face in faces], [number for number, _, _ in faces], 5 * distance)
        outer = [each for each, twin in zip(faces, inside.tolist(), strict=True) if not twin]
        sewing = _sew_faces([face for _, _, face in outer], distance)
        joined = _take_solids(sewing.SewedShape())
        if joined:
            known = ShapeMap()
            for number, k, face in outer:
                known.set(sewing.Modified(face) if sewing.IsModified(face) else face, (number, k))
            return joined, known
    return None


def _take_solids(sewn: Any) -> list[Any]:
    """The solids that the shells of a shape bound; none where one is open or bounds none that is sound."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeSolid
    from OCP.TopAbs import TopAbs_SHELL
    from OCP.TopoDS import TopoDS

    shells = [TopoDS.Shell_s(shell) for shell in explore(sewn, TopAbs_SHELL)]
    if not all(BRep_Tool.IsClosed_s(shell) for shell in shells):
        return []
    try:
        return [orient_solid(BRepBuilderAPI_MakeSolid(shell).Solid()) for shell in shells]
    except StockError:
        return []


def _find_twins(faces: Sequence[Any], owners: Sequence[int], near: float) -> Any:
    """(F,) whether another solid has the same face, by its centre and area, within ``near``."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from scipy.spatial import cKDTree

    rows = []
    for face in faces:
        sizes = GProp_GProps()
        BRepGProp.SurfaceProperties_s(face, sizes, 1e-7)
        rows.append((*sizes.CentreOfMass().Coord(), np.sqrt(max(sizes.Mass(), 0.0))))
    values: Floats = np.array(rows)
    twins = np.zeros(len(faces), bool)
    for one, two in cKDTree(values).query_pairs(near):
        if owners[one] != owners[two]:
            twins[[one, two]] = True
    return twins
