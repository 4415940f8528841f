"""Scans stored as meshes: the vertices of STL, OBJ, OFF and 3MF files.

Of its faces only their corners are used: a vertex of none is no point. So holes, edges of three triangles and wrong
turns do not matter.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from damageest.artefacts import Floats
from damageest.geometry.duplicates import find_duplicates
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_unit, scale_colours
from damageest.io.points.corners import list_obj_corners, list_off_corners
from damageest.io.points.loose import drop_loose
from damageest.io.points.off import read_off_rows
from damageest.io.points.text import parse_numbers
from damageest.io.triangles import read_stl_corners, read_triangles

NOTE = "the file is a mesh; its vertices are used as the scan's points"


def read(path: Path, columns: str | None = None) -> PointFile:
    """The vertices of the mesh's faces."""
    readers = {".stl": _read_stl, ".obj": _read_obj, ".off": _read_off, ".3mf": _read_3mf}
    file = readers[path.suffix.lower()](path)
    return replace(file, notes=(NOTE, *file.notes))


def _read_stl(path: Path) -> PointFile:
    corners = read_stl_corners(path).reshape(-1, 3)
    return PointFile(corners[find_duplicates(corners)[0]])


def _read_3mf(path: Path) -> PointFile:
    vertices, _, unit = read_triangles(path, ".3mf")
    return PointFile(vertices, unit=unit, unit_said=f"unit={unit}" if unit else "")


def _read_obj(path: Path) -> PointFile:
    data = path.read_bytes()
    unit, said = find_unit([line.decode("latin-1").lstrip("#") for line in re.findall(rb"^#.*$", data[:4096], re.M)])
    table = read_obj_vertices(data)
    colours = scale_colours(table[:, 3:6]) if table.shape[1] in (6, 7) else None  # not a weight alone
    file = PointFile(table[:, :3], colours=colours, unit=unit, unit_said=said)
    return drop_loose(file, list_obj_corners(path, data))


def read_obj_vertices(data: bytes) -> Floats:
    """The numbers (V,3 or more) of the vertices in the text of an OBJ file. Raises FormatError where it has none, or
    they differ in number."""
    rows = re.findall(rb"^[ \t]*v[ \t]+([^\n#]*)", data, re.MULTILINE)
    if not rows:
        raise FormatError("the OBJ file has no vertices ('v x y z')")
    width = len(rows[0].split())
    values = parse_numbers(b" ".join(rows))
    if width < 3 or len(values) != width * len(rows):
        raise FormatError("not all vertices have three coordinates; the file may be truncated")
    return values.reshape(-1, width)


def _read_off(path: Path) -> PointFile:
    comments = re.findall(rb"#([^\r\n]*)", path.read_bytes()[:4096])
    unit, said = find_unit([line.decode("latin-1") for line in comments])
    table, faces, expected, mark = read_off_rows(path)
    coloured = mark == "C" and table.shape[1] >= 6
    colours = scale_colours(table[:, 3:6]) if coloured else None
    file = PointFile(table[:, :3], colours=colours, unit=unit, unit_said=said)
    return drop_loose(file, list_off_corners(path, faces, expected))
