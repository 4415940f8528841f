"""Edges between faces of a solid: smooth, convex or concave, with the faces' normals along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.vectors import normalise
from damageest_cadquery.reading.read import explore

SMOOTH = 5e-4
"""Angle between normals, in radians, up to which faces are smooth together."""
SAMPLES = 33
"""Places along an edge at which its normals are taken."""
SINGULAR = 1e-7
"""Ratio of a surface's derivatives below which they have no normal."""
BESIDE = 1e-4
"""How far beside such a place the normal is taken, as a share of the way to the middle of the face."""


@dataclass(frozen=True, eq=False)
class Edge:
    """An edge between faces ``first`` and ``second``, along the outline of the first.

    ``points``, ``normals`` (S,3), ``others`` (S,3), ``tangents``: places from its start to its end, the normals of the
    first and of the second face there, and its direction. ``turns`` (S,): angles between the normals, positive where
    it is convex. ``vertices``: its start and its end.
    """

    shape: Any
    first: int
    second: int
    points: Floats
    tangents: Floats
    normals: Floats
    others: Floats
    turns: Floats
    vertices: tuple[Any, Any]

    @property
    def length(self) -> float:
        """Of its chords."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())

    @property
    def kind(self) -> Literal["smooth", "convex", "concave", "mixed"]:
        """How the faces meet, all along it. At its ends a sharp edge may be smooth, as where two fillets meet that go
        over into one plane."""
        if (np.abs(self.turns) <= SMOOTH).all():
            return "smooth"
        within = self.turns[1:-1]
        if (within > SMOOTH).all() and (self.turns >= -SMOOTH).all():
            return "convex"
        return "concave" if (within < -SMOOTH).all() and (self.turns <= SMOOTH).all() else "mixed"

    def tapers(self, end: int) -> bool:
        """Whether a sharp edge is smooth at its start, 0, or at its end, -1."""
        return bool(abs(self.turns[end]) <= SMOOTH)


def find_edges(faces: Sequence[Any]) -> list[Edge]:
    """The edges that two of the faces share."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_EDGE
    from OCP.TopoDS import TopoDS
    from OCP.TopTools import TopTools_IndexedMapOfShape

    index = TopTools_IndexedMapOfShape()
    uses: dict[int, list[tuple[int, Any]]] = {}
    for number, face in enumerate(faces):
        for edge in explore(face, TopAbs_EDGE):
            if not BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge)):
                uses.setdefault(index.Add(edge), []).append((number, TopoDS.Edge_s(edge)))
    found = []
    for mine in uses.values():
        if len(mine) == 2 and mine[0][0] != mine[1][0]:
            (first, edge), (second, other) = mine
            found.append(_measure_edge(edge, other, faces, first, second))
    return found


def _measure_edge(edge: Any, other: Any, faces: Sequence[Any], first: int, second: int) -> Edge:
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.gp import gp_Pnt, gp_Vec
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopExp import TopExp

    curve = BRepAdaptor_Curve(edge)
    parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), SAMPLES)
    reverse = edge.Orientation() == TopAbs_REVERSED
    if reverse:
        parameters = parameters[::-1]
    points, tangents = np.empty((SAMPLES, 3)), np.empty((SAMPLES, 3))
    for k, parameter in enumerate(parameters.tolist()):
        point, way = gp_Pnt(), gp_Vec()
        curve.D1(parameter, point, way)
        points[k], tangents[k] = point.Coord(), way.Coord()
    tangents = normalise(-tangents if reverse else tangents)
    normals, others = (
        measure_normals(shape, faces[number], parameters) for shape, number in ((edge, first), (other, second))
    )
    outward = np.cross(tangents, normals)
    turns = np.arctan2(np.einsum("ij,ij->i", others, outward), np.einsum("ij,ij->i", others, normals))
    ends = (TopExp.FirstVertex_s(edge, True), TopExp.LastVertex_s(edge, True))
    return Edge(edge, first, second, points, tangents, normals, others, turns, ends)


def measure_normals(edge: Any, face: Any, parameters: Floats) -> Floats:
    """(S,3) the outward unit normals of a face along one of its edges.

    At the pole of a sphere and at the apex of a cone, where the derivatives of the surface have no normal, that beside
    it, towards the middle of the face.
    """
    from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
    from OCP.BRepTools import BRepTools
    from OCP.gp import gp_Pnt, gp_Vec
    from OCP.TopAbs import TopAbs_REVERSED

    surface, curve = BRepAdaptor_Surface(face, False), BRepAdaptor_Curve2d(edge, face)
    found = np.empty((len(parameters), 3))
    middle = 0.5 * np.array(BRepTools.UVBounds_s(face)).reshape(2, 2).sum(axis=1)
    for k, parameter in enumerate(parameters.tolist()):
        place = np.array(curve.Value(parameter).Coord())
        point, u, v = gp_Pnt(), gp_Vec(), gp_Vec()
        surface.D1(*place.tolist(), point, u, v)
        if min(u.Magnitude(), v.Magnitude()) < SINGULAR * max(u.Magnitude(), v.Magnitude()):
            surface.D1(*(place + BESIDE * (middle - place)).tolist(), point, u, v)
        found[k] = np.cross(u.Coord(), v.Coord())
    found *= -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    return normalise(found)
