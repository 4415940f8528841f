"""Triangulates OpenCASCADE solids without gaps: faces are joined by the topology of their edges, not by coordinates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.errors import InputError
from damageest_cadquery.reading._mesh import mesh_solid
from damageest_cadquery.reading.read import explore, find_box

_CHECKED = 2000


@dataclass(frozen=True)
class Tessellation:
    """``vertices`` (V,3), ``faces`` (F,3); ``faces_brep`` (F,), the number of each triangle's CAD face; those faces'
    ``names`` and ``kinds``; ``error``, the largest distance found between triangles and CAD surface; the faces
    ``left_out`` that have no triangles, as words.
    """

    vertices: Floats
    faces: Ints
    faces_brep: Ints
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    error: float
    left_out: tuple[str, ...] = ()


def measure_diagonal(solids: list[Any]) -> float:
    """The diagonal of the box around all solids."""
    return float(np.sqrt(find_box(solids).SquareExtent()))


def tessellate(solids: list[Any], chord: float, angle: float, name_of: Callable[[Any], str]) -> Tessellation:
    """Triangulates within ``chord`` and ``angle`` (degrees) and joins the faces of each solid along their edges.

    On doubly curved faces the mesher can exceed the chord. Where the measured error shows this, the mesher runs once
    more with a smaller chord.
    """
    first = _tessellate_once(solids, chord, angle, name_of)
    if first.error <= 1.1 * chord:
        return first
    second = _tessellate_once(solids, chord * max(chord / first.error, 0.25), angle, name_of)
    return second if second.error < first.error else first


def _tessellate_once(solids: list[Any], chord: float, angle: float, name_of: Callable[[Any], str]) -> Tessellation:
    builder = _Builder(chord, name_of)
    for solid in solids:
        builder.add(mesh_solid(solid, chord, float(np.radians(angle))), solid)
    return builder.joined()


def name_kind(adaptor: Any) -> str:
    """A surface's kind: plane, cylinder, b_spline_surface, ..."""
    kind: str = adaptor.GetType().name.removeprefix("GeomAbs_")
    return "".join(f"_{c.lower()}" if c.isupper() else c for c in kind).lstrip("_")


class _Builder:
    """Collects the triangulations of the faces, and which of their nodes are the same point."""

    def __init__(self, chord: float, name_of: Callable[[Any], str]) -> None:
        self.chord = chord
        self.name_of = name_of
        self.points: list[Floats] = []
        self.triangles: list[Ints] = []
        self.names: list[str] = []
        self.kinds: list[str] = []
        self.same: list[tuple[Ints, Ints]] = []
        self.count = 0
        self.left_out: list[str] = []
        self.error = 0.0

    def add(self, solid: Any, original: Any) -> None:
        """``solid`` with triangles, and the ``original``, whose faces carry the names and have the same order."""
        from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
        from OCP.TopExp import TopExp
        from OCP.TopoDS import TopoDS
        from OCP.TopTools import TopTools_IndexedMapOfShape

        edges, corners = TopTools_IndexedMapOfShape(), TopTools_IndexedMapOfShape()
        TopExp.MapShapes_s(solid, TopAbs_EDGE, edges)
        TopExp.MapShapes_s(solid, TopAbs_VERTEX, corners)
        on_edge: dict[int, Ints] = {}
        at_corner: dict[int, int] = {}
        for shape, named in zip(explore(solid, TopAbs_FACE), explore(original, TopAbs_FACE), strict=True):
            face = TopoDS.Face_s(shape)
            found = self._face(face, self.name_of(TopoDS.Face_s(named)))
            if found is None:
                continue
            triangulation, location, start = found
            for item in explore(face, TopAbs_EDGE):
                edge = TopoDS.Edge_s(item)
                nodes = _find_edge_nodes(edge, triangulation, location)
                if nodes is None:
                    continue
                nodes = nodes + start
                key = edges.FindIndex(edge)
                first = on_edge.setdefault(key, nodes)
                if len(first) != len(nodes):
                    raise InputError("two faces divide their common edge differently; set another part.chord")
                self.same.append((first, nodes))
                # in the direction of the edge, not of the face
                ends = (TopExp.FirstVertex_s(edge, False), TopExp.LastVertex_s(edge, False))
                for vertex, node in zip(ends, (int(nodes[0]), int(nodes[-1])), strict=True):
                    if not vertex.IsNull():
                        known = at_corner.setdefault(corners.FindIndex(vertex), node)
                        self.same.append((np.array([known]), np.array([node])))

    def _face(self, face: Any, name: str) -> tuple[Any, Any, int] | None:
        from OCP.BRep import BRep_Tool
        from OCP.BRepAdaptor import BRepAdaptor_Surface
        from OCP.TopAbs import TopAbs_REVERSED
        from OCP.TopLoc import TopLoc_Location

        location = TopLoc_Location()
        triangulation = BRep_Tool.Triangulation_s(face, location)
        adaptor = BRepAdaptor_Surface(face)
        number = len(self.names)
        self.names.append(name)
        self.kinds.append(name_kind(adaptor))
        if triangulation is None:
            # often a face narrower than the mesher's resolution, whose edges coincide
            self.left_out.append(_describe(face, number, name, self.kinds[-1]))
            return None
        move = location.Transformation()
        nodes = range(1, triangulation.NbNodes() + 1)
        points = np.array([triangulation.Node(i).Transformed(move).Coord() for i in nodes])
        triangles = np.array(
            [triangulation.Triangle(i).Get() for i in range(1, triangulation.NbTriangles() + 1)], dtype=np.int64
        ).reshape(-1, 3)
        triangles = triangles - 1
        if triangulation.HasUVNodes() and self.kinds[-1] != "plane" and len(triangles):
            uv = np.array([triangulation.UVNode(i).Coord() for i in nodes])
            self.error = max(self.error, _measure_error(adaptor, points, uv, triangles, self.chord))
        if face.Orientation() == TopAbs_REVERSED:
            triangles = triangles[:, ::-1]
        start = self.count
        self.points.append(points)
        self.triangles.append(np.column_stack([triangles + start, np.full(len(triangles), number)]))
        self.count += len(points)
        return triangulation, location, start

    def joined(self) -> Tessellation:
        """One mesh of all faces."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        if not self.count:
            raise InputError("none of its faces could be triangulated; set another part.chord")
        a = np.concatenate([pair[0] for pair in self.same] or [np.empty(0, np.int64)])
        b = np.concatenate([pair[1] for pair in self.same] or [np.empty(0, np.int64)])
        graph = coo_matrix((np.ones(len(a), bool), (a, b)), shape=(self.count, self.count))
        label = connected_components(graph, directed=False)[1].astype(np.int64)
        _, first = np.unique(label, return_index=True)
        rows = np.concatenate(self.triangles)
        faces = label[rows[:, :3]]
        i, j, k = faces.T
        proper = (i != j) & (j != k) & (k != i)
        return Tessellation(
            np.concatenate(self.points)[first],
            faces[proper],
            rows[proper, 3],
            tuple(self.names) if any(self.names) else (),
            tuple(self.kinds),
            self.error,
            tuple(self.left_out),
        )


def _describe(face: Any, number: int, name: str, kind: str) -> str:
    """A face in words: its number, name and kind, and where it is."""
    x, y, z = find_box([face]).CornerMin().Coord()
    return f"face {number}{f' ({name})' if name else ''}, a {kind} near ({x:.4g}, {y:.4g}, {z:.4g})"


def _find_edge_nodes(edge: Any, triangulation: Any, location: Any) -> Ints | None:
    """The triangulation's nodes along an edge, in the direction of the edge, counted from 0."""
    from OCP.BRep import BRep_Tool

    polygon = BRep_Tool.PolygonOnTriangulation_s(edge, triangulation, location)
    if polygon is None:
        return None
    return np.array([polygon.Node(i) for i in range(1, polygon.NbNodes() + 1)], dtype=np.int64) - 1


def _measure_error(adaptor: Any, points: Floats, uv: Floats, triangles: Ints, chord: float) -> float:
    """The largest distance from triangle centres and edge midpoints to the surface.

    Each is compared with the surface point at the same parameters, along the normal there. Where the distance is more
    than ``chord``, the parameters are first moved to the foot of the perpendicular by Gauss-Newton steps: on cones and
    splines parameters are not proportional to length. Of a face with many triangles, about 2,000 are checked.
    """
    some = triangles[:: max(1, len(triangles) // _CHECKED)]
    weights = np.array([[1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
    flat = np.einsum("wc,tcj->twj", weights, points[some]).reshape(-1, 3)
    where = np.einsum("wc,tcj->twj", weights, uv[some]).reshape(-1, 2)
    low, high = uv.min(0), uv.max(0)
    found, tangent = _measure_offsets(adaptor, flat, where)
    far = np.flatnonzero(found > chord)
    for _ in range(4):
        if not len(far):
            break
        # a vanishing tangent, as at a pole, makes the step 0 along it
        step = np.einsum("nij,nj->ni", np.linalg.pinv(tangent[far][:, :2].swapaxes(1, 2)), tangent[far, 2])
        where[far] = np.clip(where[far] + step, low, high)
        better, tangent[far] = _measure_offsets(adaptor, flat[far], where[far])
        found[far] = better
    return float(found.max())


def _measure_offsets(adaptor: Any, points: Floats, uv: Floats) -> tuple[Floats, NDArray[np.float64]]:
    """Distances (N,) of points to the surface at ``uv`` along its normal; (N,3,3): both tangents and the offset."""
    from OCP.gp import gp_Pnt, gp_Vec

    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    rows = np.empty((len(points), 3, 3))
    for row, (u, v) in zip(rows, uv.tolist(), strict=True):
        adaptor.D1(u, v, point, along_u, along_v)
        row[0], row[1], row[2] = along_u.Coord(), along_v.Coord(), point.Coord()
    rows[:, 2] = points - rows[:, 2]
    normal = np.cross(rows[:, 0], rows[:, 1])
    length = np.linalg.norm(normal, axis=1)
    regular = length > 1e-9 * np.linalg.norm(rows[:, 0], axis=1).max() * np.linalg.norm(rows[:, 1], axis=1).max()
    along = np.abs(np.einsum("ij,ij->i", rows[:, 2], normal)) / np.where(regular, length, 1)
    return np.where(regular, along, np.linalg.norm(rows[:, 2], axis=1)), rows
