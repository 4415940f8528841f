"""Writes solids as STEP: planar faces, the job's unit, a product name, and the same bytes each time."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Solid
from damageest.geometry.bodies import split_shells
from damageest.geometry.units import MILLIMETRES
from damageest.stages.export import Body, ExportedFiles
from damageest_cadquery._facets import FLAT, Facet, find_facets, weld

UNITS = {"um": "UM", "mm": "MM", "cm": "CM", "m": "M", "in": "INCH", "ft": "FT"}
MAX_FACES = 100_000
"""Largest number of planar faces in a STEP file; 60,000 took 11 s to write, 22 s to read, and 67 MB."""


def write_step(folder: Path, stem: str, solids: Sequence[Body], unit: str) -> ExportedFiles:
    """Writes one solid as faceted STEP; with too many faces the file is left out, and a note says so."""
    (body,) = solids
    parts = [[_find_planar_faces(each) for each in (outer, *cavities)] for outer, cavities in split_shells(body.solid)]
    count = sum(len(shell[1]) for part in parts for shell in part)
    if count > MAX_FACES:
        return ExportedFiles(
            notes=(
                f"{stem}.step was not written: {count} planar faces are more than the limit of {MAX_FACES}; "
                "set a larger  detail , or use 3mf",
            )
        )
    write_shape(folder / f"{stem}.step", _build_shape(parts, MILLIMETRES[unit]), body.name, unit)
    return ExportedFiles((f"{stem}.step",))


def build_solid(solid: Solid) -> tuple[Any, int]:
    """An OpenCASCADE solid with planar faces, or a compound of several, and its number of faces. In millimetres."""
    parts = [[_find_planar_faces(each) for each in (outer, *cavities)] for outer, cavities in split_shells(solid)]
    return _build_shape(parts, 1.0), sum(len(shell[1]) for part in parts for shell in part)


def _find_planar_faces(solid: Solid) -> tuple[Floats, list[Facet]]:
    solid = weld(solid)
    return solid.vertices, find_facets(solid)


def write_shape(path: Path, shape: Any, name: str, unit: str, curves: bool = False) -> None:
    """Writes an OpenCASCADE shape, in millimetres, as STEP in ``unit``.

    ``curves``: also write edges as curves in the parameters of the faces; planes do not need them. Raises OSError where
    the file cannot be written.
    """
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.Interface import Interface_Static
    from OCP.Message import Message
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Controller, STEPControl_Writer

    Message.DefaultMessenger_s().ChangePrinters().Clear()  # else OpenCASCADE prints to the terminal
    STEPControl_Controller.Init_s()
    wanted = {"write.step.unit": UNITS[unit], "write.step.product.name": name}
    before = {key: Interface_Static.CVal_s(key) for key in wanted}
    numbers = {"write.surfacecurve.mode": int(curves), "write.step.assembly": 0}  # the latter: one product
    earlier = {key: Interface_Static.IVal_s(key) for key in numbers}
    try:
        for key, value in wanted.items():
            Interface_Static.SetCVal_s(key, value)
        for key, number in numbers.items():
            Interface_Static.SetIVal_s(key, number)
        writer = STEPControl_Writer()
        writer.Transfer(shape, STEPControl_AsIs)
        if writer.Write(str(path)) != IFSelect_RetDone:
            raise OSError(f"{path}: OpenCASCADE could not write it")
    finally:
        for key, value in before.items():
            Interface_Static.SetCVal_s(key, value)
        for key, number in earlier.items():
            Interface_Static.SetIVal_s(key, number)
    fix_header(path)


def fix_header(path: Path) -> None:
    """Removes from a STEP file the date, and the numbers that OpenCASCADE gives to products."""
    data = path.read_bytes()
    head, rest = data[:4096], data[4096:]
    head = re.sub(rb"'\d{4}-\d\d-\d\dT[\d:]+[^']*'", b"'1970-01-01T00:00:00'", head)
    # OpenCASCADE numbers the products that a process writes, and breaks the line by the length of the number
    product = rb"PRODUCT\('(.*?) \d+',\s*'.*? \d+',\s*'',\s*\(\s*(#\d+)\s*\)\s*\);"
    head = re.sub(product, rb"PRODUCT('\1','\1','',(\2));", head, flags=re.DOTALL)
    data, number = head + rest, iter(range(1, 1_000_000))
    # it numbers the components of assemblies too
    use = rb"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\(\s*)'\d+'"
    path.write_bytes(re.sub(use, lambda found: found[1] + b"'%d'" % next(number), data))


def _build_shape(parts: list[list[tuple[Floats, list[Facet]]]], scale: float) -> Any:
    """A solid, or a compound of several; the first shell of each is the outer one."""
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound, TopoDS_Solid

    builder = BRep_Builder()
    made = []
    for part in parts:
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        for number, (vertices, planar) in enumerate(part):
            shell = build_shell(vertices * scale, planar)
            builder.Add(solid, shell if number == 0 else shell.Reversed())
        made.append(solid)
    if len(made) == 1:
        return made[0]
    compound = TopoDS_Compound()
    builder.MakeCompound(compound)
    for solid in made:
        builder.Add(compound, solid)
    return compound


def build_shell(vertices: Floats, planar: Sequence[Facet], closed: bool = True) -> Any:
    """A shell whose faces share their edges, and its edges their corners. Lengths in millimetres."""
    from OCP.BRep import BRep_Builder
    from OCP.Geom import Geom_Line, Geom_Plane
    from OCP.gp import gp_Dir, gp_Pnt
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shell, TopoDS_Vertex, TopoDS_Wire

    builder = BRep_Builder()
    close = max(1e-7, 4 * FLAT * float(np.linalg.norm(np.ptp(vertices, axis=0))))
    places = vertices.tolist()
    corners: dict[int, Any] = {}
    edges: dict[tuple[int, int], Any] = {}

    def corner(index: int) -> Any:
        if index not in corners:
            corners[index] = TopoDS_Vertex()
            builder.MakeVertex(corners[index], gp_Pnt(*places[index]), close)
        return corners[index]

    def edge(start: int, end: int) -> Any:
        key = (min(start, end), max(start, end))
        if key not in edges:
            (x, y, z), (u, v, w) = places[key[0]], places[key[1]]
            made, length = TopoDS_Edge(), math.dist(places[key[0]], places[key[1]])
            line = Geom_Line(gp_Pnt(x, y, z), gp_Dir(u - x, v - y, w - z))
            builder.MakeEdge(made, line, close)
            builder.Add(made, corner(key[0]))
            builder.Add(made, corner(key[1]).Oriented(TopAbs_REVERSED))
            builder.Range(made, 0.0, length)
            edges[key] = made
        return edges[key] if start < end else edges[key].Reversed()

    shell = TopoDS_Shell()
    builder.MakeShell(shell)
    for facet in planar:
        face = TopoDS_Face()
        loops = [loop.tolist() for loop in facet.loops]
        corners_here = [places[index] for index in loops[0]]
        at = (sum(values) / len(corners_here) for values in zip(*corners_here, strict=True))
        builder.MakeFace(face, Geom_Plane(gp_Pnt(*at), gp_Dir(*facet.normal.tolist())), close)
        for indices in loops:
            wire = TopoDS_Wire()
            builder.MakeWire(wire)
            for start, end in zip(indices, indices[1:] + indices[:1], strict=True):
                if places[start] != places[end]:  # no length, no direction
                    builder.Add(wire, edge(start, end))
            wire.Closed(True)
            builder.Add(face, wire)
        builder.Add(shell, face)
    shell.Closed(closed)
    return shell
