"""Writes a B-spline surface as STEP: one face, which ends at its rims."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest.geometry.units import MILLIMETRES
from damageest.stages.export import Patch
from damageest_cadquery.writing.step import Way, call_in_process, write_first, write_shape


def write_patch(path: Path, name: str, patch: Patch, unit: str) -> str:
    """Writes the patch, with its product ``name``, in ``unit``; gives what is to be said of the file, empty for
    nothing.

    Raises OSError where the file cannot be written.
    """
    try:
        return call_in_process(write_face, path, name, patch, unit)
    except StageError as error:
        return f"was not written: the process that writes it {error.message}"


def write_face(scratch: Path, path: Path, name: str, patch: Patch, unit: str) -> str:
    """Writes the patch in this process, and reads it back."""
    shape = _build_face(patch, MILLIMETRES[unit])

    def write(curves: bool) -> Way:
        said = "with the curves of its rims in its parameters" if curves else "without curves in its parameters"
        return Way(said, lambda: shape, lambda place, face: write_shape(place, face, name, unit, curves))

    return write_first(scratch, path, (write(True), write(False))).said


def _build_face(patch: Patch, scale: float) -> Any:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace

    surface = build_surface(patch, scale)
    if not patch.rims:
        return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()
    wires = [build_wire(rim, surface) for rim in patch.rims]
    maker = BRepBuilderAPI_MakeFace(surface, wires[0], True)
    for wire in wires[1:]:
        maker.Add(wire)
    return maker.Face()


def build_surface(patch: Patch, scale: float) -> Any:
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    rows, columns = patch.poles.shape[:2]
    poles = TColgp_Array2OfPnt(1, rows, 1, columns)
    for i, row in enumerate((patch.poles * scale).tolist(), 1):
        for j, pole in enumerate(row, 1):
            poles.SetValue(i, j, gp_Pnt(*pole))
    arrays: list[Any] = []
    for knots in patch.knots:
        values, times = np.unique(knots, return_counts=True)
        real, whole = TColStd_Array1OfReal(1, len(values)), TColStd_Array1OfInteger(1, len(values))
        for k, (value, count) in enumerate(zip(values.tolist(), times.tolist(), strict=True), 1):
            real.SetValue(k, value)
            whole.SetValue(k, count)
        arrays.append((real, whole))
    (u, u_times), (v, v_times) = arrays
    return Geom_BSplineSurface(poles, u, v, u_times, v_times, patch.degree, patch.degree)


def build_wire(rim: Floats, surface: Any) -> Any:
    """A closed wire of straight segments in the parameters of the surface."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeVertex, BRepBuilderAPI_MakeWire
    from OCP.BRepLib import BRepLib
    from OCP.Geom2d import Geom2d_Line
    from OCP.gp import gp_Dir2d, gp_Pnt2d

    maker = BRepBuilderAPI_MakeWire()
    corners = [BRepBuilderAPI_MakeVertex(surface.Value(*point)).Vertex() for point in rim.tolist()]
    for k in range(len(rim)):
        start, end = rim[k], rim[(k + 1) % len(rim)]
        length = float(np.linalg.norm(end - start))
        line = Geom2d_Line(gp_Pnt2d(*start.tolist()), gp_Dir2d(*((end - start) / length).tolist()))
        edge = BRepBuilderAPI_MakeEdge(line, surface, corners[k], corners[(k + 1) % len(rim)], 0.0, length).Edge()
        maker.Add(edge)
    wire = maker.Wire()
    BRepLib.BuildCurves3d_s(wire)
    return wire
