"""Stock on concave cylinders whose radius is less than the stock is high, as fillets: it ends at their axis.

There the offset would fold. What lies beyond the axis, as the normals go, is over the faces on both sides of a fillet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.face_measures import measure_area
from damageest_cadquery.solids.joining import StockError, orient_solid
from damageest_cadquery.solids.split import is_watertight, measure_volume

SAME = 1e-5
"""Largest relative difference between the volume of a wedge and half of the area times the radius."""
CHORDS = 16
"""Chords of triangles in the radius, where it is tried whether triangles of a wedge close."""
STRAIGHT = 1e-9
"""One minus the cosine between the axis and an end of a part that is straight."""
SAMPLES = 33
"""Places along an edge at which its foot on the axis is taken."""
NEAR = 1e-7
"""Distance, in radii, within which two places of an axis are one; and the relative error of areas."""


def is_narrow(face: Any, height: float) -> bool:
    """Whether a face is a concave cylinder over which stock of a height reaches to its axis."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_Cylinder
    from OCP.TopAbs import TopAbs_REVERSED

    surface = BRepAdaptor_Surface(face)
    if surface.GetType() != GeomAbs_Cylinder:
        return False
    cylinder = surface.Cylinder()
    hollow = cylinder.Position().Direct() == (face.Orientation() == TopAbs_REVERSED)
    return bool(hollow and cylinder.Radius() <= height * (1 + NEAR))


def build_wedge(face: Any) -> Any:
    """The solid between a cylinder's face and its axis. Raises StockError where OpenCASCADE cannot make it."""
    from OCP.BOPAlgo import BOPAlgo_MakerVolume
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_SOLID
    from OCP.TopoDS import TopoDS

    start, along, radius = _take_axis(BRepAdaptor_Surface(face).Cylinder())
    maker = BOPAlgo_MakerVolume()  # walls meet at the axis, but not edge to edge
    maker.AddArgument(face)
    for edge in explore(face, TopAbs_EDGE):
        edge = TopoDS.Edge_s(edge.Oriented(TopAbs_FORWARD))
        if BRep_Tool.Degenerated_s(edge) or BRep_Tool.IsClosed_s(edge, face):
            continue  # a seam has the metal's stock on both sides
        for wall in _build_walls(edge, start, along, NEAR * radius):
            maker.AddArgument(wall)
    maker.SetIntersect(True)
    maker.SetRunParallel(False)
    maker.SetNonDestructive(True)
    maker.Perform()
    solids = [] if maker.HasErrors() else explore(maker.Shape(), TopAbs_SOLID)
    wanted = measure_area(face, NEAR) * radius / 2
    if len(solids) != 1 or abs(measure_volume(solids[0]) / wanted - 1) > SAME:
        raise StockError("the stock is higher than the radius of a face, and cannot be ended at its axis")
    if not is_watertight(solids[0], radius / CHORDS):
        raise StockError("the stock is higher than the radius of a face, and its sides touch one another at the axis")
    return orient_solid(solids[0])


def build_end(edge: Any, face: Any, normals: Floats, height: float) -> Any:
    """The mitre over an edge between the flat end of a part and a cylinder's ``face`` with a wedge: the wedge goes on
    by the ``height`` of the stock on the end, whose normals (N,3) at the edge are given. Raises StockError for another
    end."""
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.gp import gp_Vec

    start, along, radius = _take_axis(BRepAdaptor_Surface(face).Cylinder())
    if np.abs(np.abs(normals @ along) - 1).max() > STRAIGHT:
        raise StockError("the stock is higher than the radius of a face that ends at a slant")
    (sector,) = _build_walls(edge, start, along, NEAR * radius)
    return orient_solid(BRepPrimAPI_MakePrism(sector, gp_Vec(*(height * normals.mean(axis=0)).tolist())).Shape())


def _take_axis(cylinder: Any) -> tuple[Floats, Floats, float]:
    """A place on the axis of a cylinder, its direction, and the radius."""
    start, along = (np.array(each.Coord()) for each in (cylinder.Location(), cylinder.Axis().Direction()))
    return start, along, float(cylinder.Radius())


def _build_walls(edge: Any, start: Floats, along: Floats, near: float) -> list[Any]:
    """The faces between an edge and its feet on an axis: one between two places where the feet turn back."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
    from OCP.BRepFill import BRepFill
    from OCP.gp import gp_Pnt

    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    line = BRep_Tool.Curve_s(edge, 0.0, 1.0)  # of the whole edge, in its own place

    def measure(at: Floats) -> Floats:
        return (np.array([curve.Value(one).Coord() for one in at.tolist()]) - start) @ along

    def place(height: float) -> Any:
        return gp_Pnt(*(start + height * along).tolist())

    def link(one: Any, two: Any) -> Any:
        return BRepBuilderAPI_MakeEdge(one, two).Edge()

    heights = measure(np.linspace(first, last, SAMPLES))
    if np.ptp(heights) <= near:
        ends = [curve.Value(first), curve.Value(last)]
        foot = place(heights[0])
        whole = ends[0].Distance(ends[1]) <= near
        wire = BRepBuilderAPI_MakeWire(*([edge] if whole else [edge, link(ends[1], foot), link(foot, ends[0])]))
        return [BRepBuilderAPI_MakeFace(wire.Wire(), True).Face()]
    walls = []
    for low, high in pairwise(_find_turns(measure, first, last, near)):
        at = np.linspace(low, high, SAMPLES)
        heights = measure(at)
        axis = BRepBuilderAPI_MakeEdge(_interpolate([place(height) for height in heights.tolist()], at)).Edge()
        piece = edge if (low, high) == (first, last) else BRepBuilderAPI_MakeEdge(line, low, high).Edge()
        walls.append(BRepFill.Face_s(piece, axis))
    return walls


def _find_turns(measure: Callable[[Floats], Floats], first: float, last: float, near: float) -> list[float]:
    """Both ends of a curve, and between them the parameters at which its height along the axis is largest or least."""
    from scipy.optimize import minimize_scalar

    at = np.linspace(first, last, SAMPLES)
    steps = np.diff(measure(at))
    steps[np.abs(steps) <= near / SAMPLES] = 0.0
    found = [first]
    for k in np.flatnonzero(steps[1:] * steps[:-1] < 0).tolist():
        sign = 1.0 if steps[k] < 0 else -1.0
        within = minimize_scalar(
            lambda one, sign=sign: sign * float(measure(np.array([one]))[0]),
            bounds=(at[k], at[k + 2]), method="bounded", options={"xatol": 1e-10 * (last - first)},
        )  # fmt: skip
        found.append(float(within.x))
    return [*found, last]


def _interpolate(points: Sequence[Any], at: Floats) -> Any:
    """A curve through points at given parameters."""
    from OCP.GeomAPI import GeomAPI_Interpolate
    from OCP.TColgp import TColgp_HArray1OfPnt
    from OCP.TColStd import TColStd_HArray1OfReal

    places, parameters = TColgp_HArray1OfPnt(1, len(points)), TColStd_HArray1OfReal(1, len(points))
    for k, (point, value) in enumerate(zip(points, at.tolist(), strict=True), start=1):
        places.SetValue(k, point)
        parameters.SetValue(k, value)
    maker = GeomAPI_Interpolate(places, parameters, False, 1e-9)
    maker.Perform()
    return maker.Curve()
