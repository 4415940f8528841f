"""Splits solids of the part by open surfaces, in OpenCASCADE: exact damage volumes, and what is left of the part.

Lengths are OpenCASCADE's. Nothing here runs in parallel, so that equal inputs give equal files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Solid
from damageest.errors import InputError
from damageest_cadquery.reading.read import explore, find_box
from damageest_cadquery.solids._folds import drop_folds
from damageest_cadquery.solids.facets import Facet
from damageest_cadquery.solids.planar import build_shell

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


def copy_pieces(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces with shapes of their own: OpenCASCADE adds curves to the edges that it works with, which others
    share."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

    return [replace(piece, shape=BRepBuilderAPI_Copy(piece.shape).Shape()) for piece in pieces]


def build_flat(vertices: Floats, facets: Sequence[Facet]) -> Tool:
    """An open shell of planar faces, which share edges and corners."""
    from OCP.TopAbs import TopAbs_FACE

    shell = build_shell(vertices, facets, closed=False)
    return Tool(explore(shell, TopAbs_FACE), shell)


def is_sound(pieces: Sequence[Piece], faces: Sequence[Any] = ()) -> bool:
    """Whether OpenCASCADE finds all of them valid, but for ``faces`` of the CAD file, by number, that are not valid in
    it and that no cut has changed; and whether no face hangs in them."""
    from OCP.BRepCheck import BRepCheck_Analyzer
    from OCP.TopAbs import TopAbs_FACE, TopAbs_INTERNAL

    for piece in pieces:
        analyser = BRepCheck_Analyzer(piece.shape)
        if not (analyser.IsValid() or _has_faults_of_file(analyser, piece, faces)):
            return False
        if any(face.Orientation() == TopAbs_INTERNAL for face in explore(piece.shape, TopAbs_FACE)):
            return False
    return True


def _has_faults_of_file(analyser: Any, piece: Piece, faces: Sequence[Any]) -> bool:
    """Whether all that is not valid in a piece are faces of the CAD file that were so before."""
    from OCP.BRepCheck import BRepCheck_Analyzer, BRepCheck_NoError
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX, TopAbs_WIRE

    bad = [
        (face, number)
        for face, (number, _) in zip(explore(piece.shape, TopAbs_FACE), piece.origins, strict=True)
        if not analyser.IsValid(face)
    ]
    return (
        bool(bad)
        and all(0 <= number < len(faces) and face.IsSame(faces[number]) for face, number in bad)
        and not any(BRepCheck_Analyzer(face).IsValid() for face, _ in bad)
        and all(
            analyser.IsValid(each)
            for kind in (TopAbs_VERTEX, TopAbs_EDGE, TopAbs_WIRE)
            for each in explore(piece.shape, kind)
        )
        and all(
            status == BRepCheck_NoError
            for kind in (TopAbs_SHELL, TopAbs_SOLID)
            for each in explore(piece.shape, kind)
            for status in analyser.Result(each).Status()
        )
    )


def is_valid(tool: Tool) -> bool:
    """Whether each face of a tool is sound by itself."""
    from OCP.BRepCheck import BRepCheck_Analyzer

    return all(BRepCheck_Analyzer(face).IsValid() for face in tool.faces)


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
        note_images(known, algorithm, face, origin)
    for number, face in enumerate(tool.faces):
        note_images(known, algorithm, face, (-1, number))
    return [_take_piece(shape, owner, known) for shape in explore(algorithm.Shape(), TopAbs_SOLID)]


def _take_piece(shape: Any, owner: int, known: ShapeMap) -> Piece:
    """A piece without the faces and edges that hang in it: where the tool's faces overlap beyond their common edge,
    OpenCASCADE keeps what hangs over as faces inside the solid."""
    from OCP.BRepTools import BRepTools_ReShape
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_INTERNAL

    faces = explore(shape, TopAbs_FACE)
    kept = [face for face in faces if face.Orientation() != TopAbs_INTERNAL]
    origins = tuple(known.get(face, (-1, -1)) for face in kept)
    hanging = [face for face in faces if face.Orientation() == TopAbs_INTERNAL]
    hanging += [edge for face in kept for edge in explore(face, TopAbs_EDGE) if edge.Orientation() == TopAbs_INTERNAL]
    if not hanging:
        return Piece(shape, owner, origins)
    change = BRepTools_ReShape()
    for each in hanging:
        change.Remove(each)
    cleaned = change.Apply(shape)
    if len(explore(cleaned, TopAbs_FACE)) != len(kept):
        return Piece(shape, owner, tuple(known.get(face, (-1, -1)) for face in faces))
    return Piece(cleaned, owner, origins)


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


def note_images(known: ShapeMap, algorithm: Any, face: Any, origin: Origin) -> None:
    """Notes the origin of the faces that a Boolean operation made of a face."""
    made = algorithm.Modified(face)
    if made.Size() == 0:
        if not algorithm.IsDeleted(face):
            known.set(face, origin)
    elif made.Size() == 1:
        known.set(made.First(), origin)
    else:
        for each in made:
            known.set(each, origin)


def triangulate(shape: Any, chord: float, angle: float = 0.35) -> Solid:
    """A closed mesh of a solid, within ``chord``. Where the mesher leaves a gap, it is asked once more for triangles of
    half the chord. Raises InputError or ValueError where these do not close either."""
    try:
        return _triangulate_once(shape, chord, angle)
    except (InputError, ValueError):
        return _triangulate_once(shape, chord / 2, angle)


def _triangulate_once(shape: Any, chord: float, angle: float = 0.35) -> Solid:
    from damageest_cadquery.reading.tessellate import tessellate

    mesh = tessellate([shape], chord, np.degrees(angle), lambda face: "")
    return Solid(mesh.vertices, drop_folds(mesh.faces, mesh.faces_brep))


def is_near(shape: Any, mesh: Solid) -> bool:
    """Whether the boxes of a shape and of a mesh meet."""
    box = find_box([shape])
    if box.IsVoid():  # a solid without faces
        return False
    bounds = np.array(box.Get()).reshape(2, 3)
    return bool((bounds[0] <= mesh.bounds[1]).all() and (bounds[1] >= mesh.bounds[0]).all())


def is_watertight(shape: Any, chord: float) -> bool:
    """Whether triangles of a solid close; those of some solids that BRepCheck finds valid do not."""
    try:
        return _triangulate_once(shape, chord).volume > 0
    except (InputError, ValueError):
        return False


def measure_volume(shape: Any) -> float:
    """Within 1e-5: with its fixed number of points, OpenCASCADE can be wrong by some percent where a spline turns."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    sizes = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, sizes, 1e-5, False, False)
    return float(sizes.Mass())


def estimate_volume(shape: Any) -> float:
    """Within some percent, at once: the integral that holds its error can take a minute on a part with many splines."""
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


def is_opencascade_error(error: Exception) -> bool:
    """Whether OpenCASCADE raised it: in Python its exceptions share no base of their own."""
    return type(error).__module__.startswith("OCP")
