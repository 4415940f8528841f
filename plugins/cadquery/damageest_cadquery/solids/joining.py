"""Solids of stock: turned outward, joined, and what cannot be made."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.isolation import tell_part
from damageest_cadquery.reading.read import explore
from damageest_cadquery.reading.tessellate import measure_diagonal
from damageest_cadquery.solids.split import ShapeMap, is_opencascade_error, measure_volume

SEWN = 2e-5
"""Distance in millimetres within which edges of faces are one edge, where they do not claim to be less exact."""


CLAIM = 1e-4
"""Largest tolerance of an edge, in diagonals of its solid, that joining may need."""
MOST_NAMED = 6
"""Faces that a reason names."""


class StockError(Exception):
    """The stock cannot be made of offsets of CAD faces; the message says why. ``faces``: numbers of the CAD faces whose
    stock it is, none where it is that of all."""

    def __init__(self, message: str, faces: Iterable[int] = ()) -> None:
        super().__init__(message)
        self.faces = tuple(sorted(set(faces)))

    def describe(self, names: Sequence[str]) -> str:
        """The message with the ``names`` of CAD faces by number."""
        return f"stock on {list_faces(self.faces, names)}: {self}" if self.faces else str(self)


def list_faces(numbers: Iterable[int], names: Sequence[str]) -> str:
    """CAD faces in words, each by its number and, where the file has one, its name."""
    every = sorted(set(numbers))
    told = [f"face {n}" if names[n] == f"face {n}" else f"face {n} ({names[n]})" for n in every[:MOST_NAMED]]
    more = [f"{len(every) - MOST_NAMED} more"] if len(every) > MOST_NAMED else []
    return ", ".join(told + more)


@contextmanager
def naming(faces: Iterable[int]) -> Iterator[None]:
    """What fails within is about the stock on these CAD faces, which is told. An error of OpenCASCADE becomes a
    StockError."""
    faces = tuple(sorted(set(faces)))
    tell_part(f"face {', '.join(map(str, faces[:MOST_NAMED]))}{' …' if len(faces) > MOST_NAMED else ''}")
    try:
        yield
    except StockError as error:
        error.faces = error.faces or faces
        raise
    except Exception as error:
        if not is_opencascade_error(error):
            raise
        said = str(error)[:80] or type(error).__name__
        raise StockError(f"OpenCASCADE cannot build it ({said})", faces) from None


def orient_solid(shape: Any) -> Any:
    """The one solid of a shape with its faces outward. Raises StockError where it is not sound."""
    from OCP.BRepLib import BRepLib
    from OCP.TopAbs import TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    solids = explore(_place_faces(shape), TopAbs_SOLID)
    if len(solids) != 1:
        raise StockError("the offset of a face is not one solid")
    solid = TopoDS.Solid_s(solids[0])
    BRepLib.OrientClosedSolid_s(solid)
    if not settle_edges(solid) or measure_volume(solid) <= 0:
        raise StockError("the offset of a face folds")
    return solid


def settle_edges(shape: Any) -> bool:
    """Whether a shape is valid, if need be after its edges were made to follow their faces' curves at the same
    parameters, and claim what they are off: sewing and joining can leave edges that claim less. No edge may claim more
    than `CLAIM` of the diagonal."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.BRepLib import BRepLib
    from OCP.ShapeAnalysis import ShapeAnalysis_ShapeTolerance

    if BRepCheck_Analyzer(shape).IsValid():
        return True
    BRepLib.SameParameter_s(shape, 1e-7, True)
    BRepLib.UpdateTolerances_s(shape, True)
    small = ShapeAnalysis_ShapeTolerance().Tolerance(shape, 1) <= CLAIM * measure_diagonal([shape])
    return bool(small and BRepCheck_Analyzer(shape).IsValid())


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


def turn_offsets(shape: Any) -> Any:
    """The shape with the offsets of splines as splines; itself where it has none."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_OffsetSurface
    from OCP.ShapeCustom import ShapeCustom

    if all(BRepAdaptor_Surface(face).GetType() != GeomAbs_OffsetSurface for face in explore_faces(shape)):
        return shape
    return ShapeCustom.ConvertToBSpline_s(shape, False, False, True)


def find_twin_pairs(solids: Sequence[Any], near: float) -> dict[tuple[int, int], float]:
    """The pairs of solids that have faces in common, and the area of these."""
    from scipy.spatial import cKDTree

    owned = [(number, face) for number, solid in enumerate(solids) for face in explore_faces(solid)]
    values = _measure_faces([face for _, face in owned])
    pairs: dict[tuple[int, int], float] = {}
    for one, two in sorted(cKDTree(values).query_pairs(near)):
        first, second = sorted((owned[one][0], owned[two][0]))
        if first != second:
            pairs[first, second] = pairs.get((first, second), 0.0) + float(values[one, 3] ** 2)
    return pairs


def _find_twins(faces: Sequence[Any], owners: Sequence[int], near: float) -> Any:
    """(F,) whether another solid has the same face, by its centre and area, within ``near``."""
    from scipy.spatial import cKDTree

    values = _measure_faces(faces)
    twins = np.zeros(len(faces), bool)
    for one, two in cKDTree(values).query_pairs(near):
        if owners[one] != owners[two]:
            twins[[one, two]] = True
    return twins


def _measure_faces(faces: Sequence[Any]) -> Floats:
    """(F,4) centres of faces and the roots of their areas."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    rows = []
    for face in faces:
        sizes = GProp_GProps()
        BRepGProp.SurfaceProperties_s(face, sizes, 1e-7)
        rows.append((*sizes.CentreOfMass().Coord(), np.sqrt(max(sizes.Mass(), 0.0))))
    return np.array(rows).reshape(-1, 4)
