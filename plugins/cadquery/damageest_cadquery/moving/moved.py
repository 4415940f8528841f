"""CAD solids moved by a displacement field, such as that of a part that was adapted to its scan.

Each face becomes the B-spline surface through its moved places, at the same parameters. So the curves in its
parameters that trim it stay as they are, and neighbours go on sharing their edges: nothing is sewn.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_cadquery.moving._interpolate import Breaks, interpolate_curve, interpolate_surface
from damageest_cadquery.reading.read import explore
from damageest_cadquery.solids.split import ShapeMap

Move = Callable[[Floats], Floats]
"""Gives where places (N,3) are after the displacement."""
CHECKED = 193
"""Places along an edge at which it is compared with its faces: OpenCASCADE looks for the largest distance."""
ROOM = 1.3
"""What an edge claims to be off its faces, as a share of what is measured."""
MANY = 120
"""Knots, beside those given, with which a face is tried at last."""
LEAST = 1e-7
"""Least distance in millimetres that OpenCASCADE tells apart."""


class MoveError(Exception):
    """A CAD face cannot be moved; the message says which, and why."""


def move_solid(solid: Any, move: Move, aim: float, most: float, first: int = 0) -> Any:
    """A solid whose faces follow the displacement within ``aim``, or at least within ``most``. The faces stay in their
    order. ``first``: number of its first face in messages. Raises MoveError."""
    from OCP.BRepLib import BRepLib

    moved = _Mover(move, aim, most, first).move(solid)
    BRepLib.EncodeRegularity_s(moved)
    return moved


@dataclass(eq=False)
class _Mover:
    move_places: Move
    aim: float
    most: float
    number: int
    known: ShapeMap = field(default_factory=ShapeMap)

    def move(self, shape: Any) -> Any:
        """A solid or a shell with what it holds."""
        from OCP.BRep import BRep_Builder
        from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
        from OCP.TopoDS import TopoDS, TopoDS_Shell, TopoDS_Solid

        kind, builder = shape.ShapeType(), BRep_Builder()
        if kind == TopAbs_FACE:
            return self.move_face(TopoDS.Face_s(shape))
        if kind not in (TopAbs_SOLID, TopAbs_SHELL):
            raise MoveError(f"the solid holds a loose {kind.name.removeprefix('TopAbs_').lower()}")
        made = TopoDS_Solid() if kind == TopAbs_SOLID else TopoDS_Shell()
        (builder.MakeSolid if kind == TopAbs_SOLID else builder.MakeShell)(made)
        for each in _list_parts(shape):
            builder.Add(made, self.move(each))
        if kind == TopAbs_SHELL:
            made.Closed(shape.Closed())
        return made.Oriented(shape.Orientation())

    def move_face(self, face: Any) -> Any:
        from OCP.BRep import BRep_Builder
        from OCP.TopAbs import TopAbs_FORWARD
        from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Wire

        builder, made = BRep_Builder(), TopoDS_Face()
        original = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD))
        builder.MakeFace(made, self._move_surface(original), LEAST)
        wires = _list_parts(original)
        if not wires:
            raise MoveError(f"face {self.number} has no boundary")
        for wire in wires:
            loop = TopoDS_Wire()
            builder.MakeWire(loop)
            edges = _list_parts(wire)
            for edge in edges:
                builder.Add(loop, self._move_edge(TopoDS.Edge_s(edge)).Oriented(edge.Orientation()))
            loop.Closed(True)
            builder.Add(made, loop.Oriented(wire.Orientation()))
        used = [TopoDS.Edge_s(edge) for edge in explore(original, edges[0].ShapeType())]
        for edge in used:
            self._trim(edge, sum(edge.IsSame(other) for other in used) > 1, original, made)
        self.number += 1
        return made.Oriented(face.Orientation())

    def _move_surface(self, face: Any) -> Any:
        from OCP.BRepAdaptor import BRepAdaptor_Surface

        adaptor = BRepAdaptor_Surface(face)

        def place(u: Floats, v: Floats) -> Floats:
            rows = [adaptor.Value(a, b).Coord() for a in u.tolist() for b in v.tolist()]
            return self.move_places(np.array(rows)).reshape(len(u), len(v), 3)

        breaks = (
            _find_breaks(adaptor.NbUIntervals, adaptor.UIntervals),
            _find_breaks(adaptor.NbVIntervals, adaptor.VIntervals),
        )
        axes, poles, off = interpolate_surface(place, breaks, self.aim)
        if not off <= self.most:  # as of a helix of many turns
            axes, poles, off = interpolate_surface(place, breaks, self.most / 2, MANY)
        if not off <= self.most:
            raise MoveError(
                f"the B-spline of face {self.number} is up to {off:.2g} mm off the adapted skin, more than "
                f"{self.most:.2g}"
            )
        return _make_surface(axes, _join_ends(poles))

    def _move_edge(self, edge: Any) -> Any:
        """An edge, FORWARD, with its curve and its corners; the same for all faces that share it."""
        from OCP.BRep import BRep_Builder, BRep_Tool
        from OCP.BRepAdaptor import BRepAdaptor_Curve
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopoDS import TopoDS, TopoDS_Edge

        if (known := self.known.get(edge)) is not None:
            return known
        builder, made = BRep_Builder(), TopoDS_Edge()
        builder.MakeEdge(made)
        if BRep_Tool.Degenerated_s(edge):
            builder.Degenerated(made, True)
        else:
            adaptor = BRepAdaptor_Curve(edge)

            def place(t: Floats) -> Floats:
                return self.move_places(np.array([adaptor.Value(each).Coord() for each in t.tolist()]))

            axis, poles, off = interpolate_curve(place, _find_breaks(adaptor.NbIntervals, adaptor.Intervals), self.aim)
            if not off <= self.most:
                raise MoveError(f"the B-spline of an edge of face {self.number} is up to {off:.2g} mm off")
            builder.UpdateEdge(made, _make_curve(axis, poles), LEAST)
            builder.Range(made, *BRep_Tool.Range_s(edge))
        for vertex in _list_parts(edge):
            if vertex.Orientation() in (TopAbs_FORWARD, TopAbs_REVERSED):
                corner = self._move_corner(TopoDS.Vertex_s(vertex))
                builder.Add(made, corner.Oriented(vertex.Orientation()))
        self.known.set(edge, made)
        return made

    def _move_corner(self, vertex: Any) -> Any:
        from OCP.BRep import BRep_Builder, BRep_Tool
        from OCP.gp import gp_Pnt
        from OCP.TopoDS import TopoDS_Vertex

        if (known := self.known.get(vertex)) is not None:
            return known
        made = TopoDS_Vertex()
        (place,) = self.move_places(np.array([BRep_Tool.Pnt_s(vertex).Coord()])).tolist()
        BRep_Builder().MakeVertex(made, gp_Pnt(*place), LEAST)
        self.known.set(vertex, made)
        return made

    def _trim(self, edge: Any, is_seam: bool, original: Any, made: Any) -> None:
        """Gives an edge its curve in the parameters of a moved face, and the distance that it is off the face; both
        curves where the face meets itself there, ``is_seam``. Two faces of one closed surface may meet at its seam too;
        each of them has a surface of its own now."""
        from OCP.BRep import BRep_Builder, BRep_Tool
        from OCP.BRepAdaptor import BRepAdaptor_Curve
        from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
        from OCP.TopExp import TopExp
        from OCP.TopoDS import TopoDS

        moved, builder = TopoDS.Edge_s(self.known.get(edge)), BRep_Builder()
        ahead, back = (TopoDS.Edge_s(edge.Oriented(way)) for way in (TopAbs_FORWARD, TopAbs_REVERSED))
        sides = [ahead, back] if is_seam else [edge]
        curves = [BRep_Tool.CurveOnSurface_s(each, original, 0.0, 0.0) for each in sides]
        if any(curve is None for curve in curves):
            raise MoveError(f"an edge of face {self.number} has no curve in its parameters")
        first, last = BRep_Tool.Range_s(ahead, original)
        if is_seam:
            builder.UpdateEdge(moved, curves[0], curves[1], made, LEAST)
        else:
            builder.UpdateEdge(moved, curves[0], made, LEAST)
        builder.Range(moved, made, first, last)
        surface, at = BRep_Tool.Surface_s(made), np.linspace(first, last, CHECKED)
        on_face = np.array([[surface.Value(*curve.Value(t).Coord()).Coord() for t in at.tolist()] for curve in curves])
        if BRep_Tool.Degenerated_s(moved):
            off = 0.0
        else:
            adaptor = BRepAdaptor_Curve(moved)
            there = np.linspace(adaptor.FirstParameter(), adaptor.LastParameter(), CHECKED)
            on_curve = np.array([adaptor.Value(t).Coord() for t in there.tolist()])
            off = float(np.linalg.norm(on_face - on_curve, axis=2).max())
            if off > 2 * self.most + BRep_Tool.Tolerance_s(edge):
                raise MoveError(f"an edge of face {self.number} would lie {off:.2g} mm off it")
            builder.UpdateEdge(moved, max(ROOM * off, LEAST))
        ends = TopExp.FirstVertex_s(moved), TopExp.LastVertex_s(moved)
        for corner, row in zip(ends, (0, -1), strict=True):
            if corner.IsNull():
                continue
            gap = np.linalg.norm(on_face[:, row] - np.array(BRep_Tool.Pnt_s(corner).Coord()), axis=1).max()
            builder.UpdateVertex(corner, max(ROOM * (float(gap) + off), LEAST))


def _list_parts(shape: Any) -> list[Any]:
    """What a shape is directly made of, with the orientation that it has in it, in its place."""
    from OCP.TopoDS import TopoDS_Iterator

    iterator, found = TopoDS_Iterator(shape, False, True), []
    while iterator.More():
        found.append(iterator.Value())
        iterator.Next()
    return found


def _find_breaks(count: Callable[[Any], int], write: Callable[[Any, Any], None]) -> Breaks:
    """Where a curve, or a surface along a parameter, is not smooth."""
    from OCP.GeomAbs import GeomAbs_C1, GeomAbs_C2, GeomAbs_C3, GeomAbs_CN
    from OCP.TColStd import TColStd_Array1OfReal

    smooth: dict[float, int] = {}
    for times, kind in enumerate((GeomAbs_C1, GeomAbs_C2, GeomAbs_C3, GeomAbs_CN)):
        rows = TColStd_Array1OfReal(1, count(kind) + 1)
        write(rows, kind)
        for k in range(1, rows.Length() + 1):
            smooth.setdefault(rows.Value(k), times)
    at = sorted(smooth)
    return Breaks(tuple(at), tuple(smooth[each] for each in at))


def _join_ends(poles: Floats) -> Floats:
    """Poles (N,M,3) with first and last rows the same where they are but for rounding, as on a closed surface, and
    with a row in one place where it is but for rounding."""
    poles = np.array(poles)
    near = 10 * LEAST
    if np.abs(poles[0] - poles[-1]).max() < near:
        poles[-1] = poles[0]
    if np.abs(poles[:, 0] - poles[:, -1]).max() < near:
        poles[:, -1] = poles[:, 0]
    for row in (poles[0], poles[-1], poles[:, 0], poles[:, -1]):
        if np.abs(row - row[0]).max() < near:
            row[:] = row[0]
    return poles


def _make_surface(axes: Sequence[Any], poles: Floats) -> Any:
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt

    grid = TColgp_Array2OfPnt(1, poles.shape[0], 1, poles.shape[1])
    for i, row in enumerate(poles.tolist(), 1):
        for j, pole in enumerate(row, 1):
            grid.SetValue(i, j, gp_Pnt(*pole))
    (u, u_times), (v, v_times) = (_make_knots(axis) for axis in axes)
    return Geom_BSplineSurface(grid, u, v, u_times, v_times, axes[0].degree, axes[1].degree)


def _make_curve(axis: Any, poles: Floats) -> Any:
    from OCP.Geom import Geom_BSplineCurve
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array1OfPnt

    row = TColgp_Array1OfPnt(1, len(poles))
    for i, pole in enumerate(poles.tolist(), 1):
        row.SetValue(i, gp_Pnt(*pole))
    return Geom_BSplineCurve(row, *_make_knots(axis), axis.degree)


def _make_knots(axis: Any) -> tuple[Any, Any]:
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    count = len(axis.knots)
    knots, repeats = TColStd_Array1OfReal(1, count), TColStd_Array1OfInteger(1, count)
    for k, (knot, times) in enumerate(zip(axis.knots, axis.repeats, strict=True), 1):
        knots.SetValue(k, knot)
        repeats.SetValue(k, times)
    return knots, repeats
