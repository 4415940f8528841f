"""Splits solids of the part by open surfaces, in OpenCASCADE: exact damage volumes, and what is left of the part.

Lengths are OpenCASCADE's. Nothing here runs in parallel, so that equal inputs give equal files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Mesh, Solid
from damageest_cadquery._read import explore

Origin = tuple[int, int]
"""Where a face comes from: (number of the part's CAD face, -1), or (-1, number of the tool's face)."""


@dataclass(frozen=True, eq=False)
class Tool:
    """``faces``: OpenCASCADE faces of an open shell, by which solids are split."""

    faces: Sequence[Any]
    shape: Any


@dataclass(frozen=True, eq=False)
class Piece:
    """A solid that a split gave: the number of the solid of the part that it is a piece of, and the ``origins`` of its
    faces, in the order in which `explore` gives them."""

    shape: Any
    owner: int
    origins: tuple[Origin, ...]


def build_facets(mesh: Mesh) -> Tool:
    """An open shell of planar triangles, which share edges and corners."""
    from OCP.BRep import BRep_Builder
    from OCP.Geom import Geom_Line, Geom_Plane
    from OCP.gp import gp_Dir, gp_Pnt
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shell, TopoDS_Vertex, TopoDS_Wire

    builder, close = BRep_Builder(), 1e-7
    corners = []
    for point in mesh.vertices.tolist():
        vertex = TopoDS_Vertex()
        builder.MakeVertex(vertex, gp_Pnt(*point), close)
        corners.append(vertex)
    edges: dict[tuple[int, int], Any] = {}

    def edge(start: int, end: int) -> Any:
        key = (min(start, end), max(start, end))
        if key not in edges:
            way = mesh.vertices[key[1]] - mesh.vertices[key[0]]
            length = float(np.linalg.norm(way))
            made = TopoDS_Edge()
            builder.MakeEdge(
                made, Geom_Line(gp_Pnt(*mesh.vertices[key[0]].tolist()), gp_Dir(*(way / length).tolist())), close
            )
            builder.Add(made, corners[key[0]])
            builder.Add(made, corners[key[1]].Oriented(TopAbs_REVERSED))
            builder.Range(made, 0.0, length)
            edges[key] = made
        return edges[key] if start < end else edges[key].Reversed()

    shell = TopoDS_Shell()
    builder.MakeShell(shell)
    faces = []
    for row, normal in zip(mesh.faces.tolist(), mesh.face_normals.tolist(), strict=True):
        face, wire = TopoDS_Face(), TopoDS_Wire()
        builder.MakeFace(face, Geom_Plane(gp_Pnt(*mesh.vertices[row[0]].tolist()), gp_Dir(*normal)), close)
        builder.MakeWire(wire)
        for start, end in zip(row, (*row[1:], row[0]), strict=True):
            builder.Add(wire, edge(start, end))
        wire.Closed(True)
        builder.Add(face, wire)
        builder.Add(shell, face)
        faces.append(face)
    return Tool(faces, shell)


def split(solid: Any, owner: int, origins: Sequence[Origin], tool: Tool, fuzzy: float) -> list[Piece] | None:
    """The pieces of a solid, or None where OpenCASCADE reports an error.

    ``origins`` are those of the solid's faces, in the order of `explore`. Faces of the tool become (-1, number).
    """
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Splitter
    from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
    from OCP.TopTools import TopTools_ListOfShape

    arguments, tools = TopTools_ListOfShape(), TopTools_ListOfShape()
    arguments.Append(solid)
    tools.Append(tool.shape)
    algorithm = BRepAlgoAPI_Splitter()
    algorithm.SetArguments(arguments)
    algorithm.SetTools(tools)
    algorithm.SetRunParallel(False)
    algorithm.SetNonDestructive(True)
    if fuzzy:
        algorithm.SetFuzzyValue(fuzzy)
    algorithm.Build()
    if not algorithm.IsDone():
        return None
    known = ShapeMap()
    for face, origin in zip(explore(solid, TopAbs_FACE), origins, strict=True):
        _note(known, algorithm, face, origin)
    for number, face in enumerate(tool.faces):
        _note(known, algorithm, face, (-1, number))
    return [
        Piece(shape, owner, tuple(known.get(face, (-1, -1)) for face in explore(shape, TopAbs_FACE)))
        for shape in explore(algorithm.Shape(), TopAbs_SOLID)
    ]


class ShapeMap:
    """A dictionary of shapes, regardless of their orientation."""

    def __init__(self) -> None:
        from OCP.TopTools import TopTools_IndexedMapOfShape

        self._index = TopTools_IndexedMapOfShape()
        self._values: dict[int, Any] = {}

    def set(self, shape: Any, value: Any) -> None:
        self._values.setdefault(self._index.Add(shape), value)

    def get(self, shape: Any, default: Any = None) -> Any:
        return self._values.get(self._index.FindIndex(shape), default)


def _note(known: ShapeMap, algorithm: Any, face: Any, origin: Origin) -> None:
    made = list(algorithm.Modified(face))
    for each in made or ([] if algorithm.IsDeleted(face) else [face]):
        known.set(each, origin)


def triangulate(shape: Any, chord: float, angle: float = 0.35) -> Solid:
    """A closed mesh of a solid, within ``chord``. Raises InputError or ValueError where it cannot be closed."""
    from damageest_cadquery._tessellate import tessellate

    mesh = tessellate([shape], chord, np.degrees(angle), lambda face: "")
    return Solid(mesh.vertices, mesh.faces)


def measure_volume(shape: Any) -> float:
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    sizes = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, sizes)
    return float(sizes.Mass())


def find_corners(shape: Any) -> Floats:
    """(V,3) the vertices of a shape."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_VERTEX
    from OCP.TopoDS import TopoDS

    points = [BRep_Tool.Pnt_s(TopoDS.Vertex_s(item)).Coord() for item in explore(shape, TopAbs_VERTEX)]
    return np.unique(np.array(points), axis=0)


def join_pieces(pieces: Sequence[Piece]) -> Any:
    """The solid, or a compound of several."""
    if len(pieces) == 1:
        return pieces[0].shape
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound

    builder, whole = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(whole)
    for piece in pieces:
        builder.Add(whole, piece.shape)
    return whole


def is_opencascade_error(error: Exception) -> bool:
    """Whether OpenCASCADE raised it: in Python its exceptions share no base of their own."""
    return type(error).__module__.startswith("OCP")
