"""Calls OpenCASCADE's mesher, and again with other settings where it leaves faces without triangles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from damageest_cadquery.reading.claims import COARSE, lower_claims
from damageest_cadquery.reading.read import explore

_WITHIN = 1.06
"""Deflection within faces, in chords, beside that on edges. With the same on both, a doubly curved face that is divided
by the deflection of its edges is a few percent over it within, and OpenCASCADE divides all of its triangles by four."""
OTHER_CHORDS = (0.25, 4.0)
"""Chords that are tried where faces have no triangles, in those that were asked for."""


def mesh_solid(solid: Any, chord: float, angle: float) -> Any:
    """The solid, or a copy of it with its faces in the same order, with triangles within ``chord`` and ``angle``
    (radians). Some faces of a valid solid can have none: those whose edges claim a tolerance as large as the face, and
    those whose edges, as polygons, cross one another. Other settings are tried, and those that leave fewest are taken.
    """
    best, least = solid, -1
    for copy, settings in _list_attempts(solid, chord, angle):
        _mesh(copy, settings)
        left = len(list_left_out(copy))
        if least < 0 or left < least:
            best, least = copy, left
        if not left:
            break
    return best


def list_left_out(solid: Any) -> list[int]:
    """The numbers of the faces of a meshed solid that have no triangles, from 0."""
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    found = (BRep_Tool.Triangulation_s(TopoDS.Face_s(face), TopLoc_Location()) for face in explore(solid, TopAbs_FACE))
    return [number for number, triangles in enumerate(found) if triangles is None]


def _list_attempts(solid: Any, chord: float, angle: float) -> Iterator[tuple[Any, Any]]:
    """Solids and settings to mesh them with. All but the first are copies: the mesher leaves its triangles in them."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.IMeshTools import IMeshTools_MeshAlgoType

    yield solid, _set_up(chord, angle)
    lowered = lower_claims(solid, COARSE)
    if lowered is not solid:
        yield lowered, _set_up(chord, angle)
    other = _set_up(chord, angle)
    other.MeshAlgo = IMeshTools_MeshAlgoType.IMeshTools_MeshAlgoType_Delabella
    for settings in (other, *(_set_up(share * chord, angle) for share in OTHER_CHORDS)):
        yield BRepBuilderAPI_Copy(lowered, True, False).Shape(), settings


def _set_up(chord: float, angle: float) -> Any:
    from OCP.IMeshTools import IMeshTools_Parameters

    parameters = IMeshTools_Parameters()
    parameters.Deflection, parameters.DeflectionInterior = chord, _WITHIN * chord
    parameters.MinSize = chord / 10
    parameters.Angle = angle
    parameters.Relative = parameters.InParallel = False
    # without it the inside of a trimmed sphere can deviate by ten times the chord
    parameters.EnableControlSurfaceDeflectionAllSurfaces = True
    return parameters


def _mesh(solid: Any, parameters: Any) -> None:
    from OCP.BRepMesh import BRepMesh_IncrementalMesh
    from OCP.BRepTools import BRepTools

    BRepTools.Clean_s(solid)  # the file may contain a coarser triangulation
    BRepMesh_IncrementalMesh(solid, parameters)
