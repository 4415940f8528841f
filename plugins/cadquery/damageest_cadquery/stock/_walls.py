"""The sides of stock: between an edge of a face and the edge of its offset."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats

NEAR = 1e-6
"""How far a side may be from a plane or a cone, in heights of the stock."""


def build_wall(edge: Any, top: Any) -> Any:
    """The face between an edge and the edge over it: a plane, cone or cylinder where it is one, with which Booleans are
    faster and safer than with a ruled spline."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.BRepFill import BRepFill
    from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Line

    low, high = BRepAdaptor_Curve(edge), BRepAdaptor_Curve(top)
    below, above = _take_points(low), _take_points(high)
    near = NEAR * float(np.linalg.norm(above - below, axis=1).max())
    made = None
    if low.GetType() == GeomAbs_Line:
        made = _build_plane(below, above, near)
    elif low.GetType() == GeomAbs_Circle:
        made = _revolve(low, below, above, near)
    return BRepFill.Face_s(edge, top) if made is None else made


def _take_points(curve: Any) -> Floats:
    """(9,3) places along a curve."""
    parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), 9).tolist()
    return np.array([curve.Value(at).Coord() for at in parameters])


def _build_plane(below: Floats, above: Floats, near: float) -> Any:
    """The quadrangle between two straight edges, of which there are places (9,3); None where it is none."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
    from OCP.gp import gp_Pnt

    corners = np.array([below[0], below[-1], above[-1], above[0]])
    line = above[0] + np.linspace(0, 1, len(above))[:, None] * (above[-1] - above[0])
    flat = np.linalg.svd(corners - corners.mean(axis=0), compute_uv=False)[2] <= near
    if not flat or np.abs(line - above).max() > near:
        return None
    outline = BRepBuilderAPI_MakePolygon(*(gp_Pnt(*corner.tolist()) for corner in corners), True)
    made = BRepBuilderAPI_MakeFace(outline.Wire(), True)
    return made.Face() if made.IsDone() else None


def _revolve(curve: Any, below: Floats, above: Floats, near: float) -> Any:
    """The face of revolution between two arcs about one axis, of which there are places (9,3); None without one."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeRevol
    from OCP.gp import gp_Pnt
    from OCP.TopoDS import TopoDS

    circle = curve.Circle()
    axis, centre = np.array(circle.Axis().Direction().Coord()), np.array(circle.Location().Coord())
    along = [(points - centre) @ axis for points in (below, above)]
    spokes = [points - centre - at[:, None] * axis for points, at in zip((below, above), along, strict=True)]
    radii = [np.linalg.norm(each, axis=1) for each in spokes]
    turned = np.abs(np.cross(spokes[0], spokes[1]) @ axis) / circle.Radius()
    if max(np.ptp(each) for each in (*along, *radii)) > near or turned.max() > near or radii[1][0] <= near:
        return None
    segment = BRepBuilderAPI_MakeEdge(gp_Pnt(*below[0].tolist()), gp_Pnt(*above[0].tolist())).Edge()
    made = BRepPrimAPI_MakeRevol(segment, circle.Axis(), curve.LastParameter() - curve.FirstParameter())
    return TopoDS.Face_s(made.Shape()) if made.IsDone() else None
