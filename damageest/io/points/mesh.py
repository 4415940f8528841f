"""Scans stored as meshes: the vertices of STL, OBJ, OFF and 3MF files.

Triangles are not used, so holes, edges of three triangles and wrong turns do not matter.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from damageest.geometry.duplicates import find_duplicates
from damageest.io.meshes import read_mesh, read_stl_corners
from damageest.io.points import FormatError, PointFile
from damageest.io.points.attributes import find_unit, scale_colours
from damageest.io.points.text import parse_numbers

NOTE = "the file is a mesh; its vertices are used as the scan's points"


def read(path: Path, columns: str | None = None) -> PointFile:
    """The vertices of the mesh. Its triangles are not used."""
    readers = {".stl": _read_stl, ".obj": _read_obj, ".off": _read_off, ".3mf": _read_3mf}
    return replace(readers[path.suffix.lower()](path), notes=(NOTE,))


def _read_stl(path: Path) -> PointFile:
    corners = read_stl_corners(path).reshape(-1, 3)
    return PointFile(corners[find_duplicates(corners)[0]])


def _read_3mf(path: Path) -> PointFile:
    vertices, _, unit = read_mesh(path)
    return PointFile(vertices, unit=unit, unit_said=f"unit={unit}" if unit else "")


def _read_obj(path: Path) -> PointFile:
    data = path.read_bytes()
    unit, said = find_unit([line.decode("latin-1").lstrip("#") for line in re.findall(rb"^#.*$", data[:4096], re.M)])
    rows = re.findall(rb"^[ \t]*v[ \t]+([^\n#]*)", data, re.MULTILINE)
    if not rows:
        raise FormatError("the OBJ file has no vertices ('v x y z')")
    width = len(rows[0].split())
    values = parse_numbers(b" ".join(rows))
    if width < 3 or len(values) != width * len(rows):
        raise FormatError("not all vertices have three coordinates; the file may be truncated")
    table = values.reshape(-1, width)
    colours = scale_colours(table[:, 3:6]) if width in (6, 7) else None  # not a weight alone
    return PointFile(table[:, :3], colours=colours, unit=unit, unit_said=said)


def _read_off(path: Path) -> PointFile:
    text = path.read_bytes()
    unit, said = find_unit([line.decode("latin-1") for line in re.findall(rb"#([^\r\n]*)", text[:4096])])
    data = re.sub(rb"#[^\n]*", b"", text).replace(b"\r", b"\n").strip()
    start = re.match(rb"(ST)?(C)?(N)?OFF\s+(\d+)\s+(\d+)(\s+\d+)?[ \t]*\n", data)
    if not start:
        raise FormatError("not a text OFF file")
    count = int(start.group(4))
    lines = [line for line in data[start.end() :].split(b"\n") if line.strip()][:count]
    if len(lines) < count:
        raise FormatError(f"the OFF file is truncated: it has {len(lines)} of {count} vertices")
    if not count:
        return PointFile(np.empty((0, 3)))
    values = parse_numbers(b"\n".join(lines))
    if len(values) % count or len(values) < 3 * count:
        raise FormatError("not all vertices have three coordinates")
    table = values.reshape(count, -1)
    coloured = bool(start.group(2)) and not start.group(1) and not start.group(3) and table.shape[1] >= 6
    return PointFile(
        table[:, :3], colours=scale_colours(table[:, 3:6]) if coloured else None, unit=unit, unit_said=said
    )
