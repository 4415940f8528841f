"""Scans stored as meshes: the vertices of STL, OBJ and OFF files, without duplicates."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.duplicates import find_duplicates
from damageest.io.meshes import read_stl_corners
from damageest.io.points import FormatError, PointFile
from damageest.io.points.text import parse_numbers


def read(path: Path, columns: str | None = None) -> PointFile:
    """The vertices of the mesh. Its triangles are not used."""
    points = {".stl": _read_stl, ".obj": _read_obj, ".off": _read_off}[path.suffix.lower()](path)
    return PointFile(points, notes=("the file is a mesh; its vertices are used as the scan's points",))


def _read_stl(path: Path) -> Floats:
    corners = read_stl_corners(path).reshape(-1, 3)
    return corners[find_duplicates(corners)[0]]


def _read_obj(path: Path) -> Floats:
    rows = re.findall(rb"^[ \t]*v[ \t]+([^\n#]*)", path.read_bytes(), re.MULTILINE)
    if not rows:
        raise FormatError("the OBJ file has no vertices ('v x y z')")
    width = len(rows[0].split())
    values = parse_numbers(b" ".join(rows))
    if width < 3 or len(values) != width * len(rows):
        raise FormatError("not all vertices have three coordinates; the file may be truncated")
    return values.reshape(-1, width)[:, :3]


def _read_off(path: Path) -> Floats:
    data = re.sub(rb"#[^\n]*", b"", path.read_bytes()).replace(b"\r", b"\n").strip()
    start = re.match(rb"(ST)?(C)?(N)?OFF\s+(\d+)\s+(\d+)(\s+\d+)?[ \t]*\n", data)
    if not start:
        raise FormatError("not a text OFF file")
    count = int(start.group(4))
    lines = [line for line in data[start.end() :].split(b"\n") if line.strip()][:count]
    if len(lines) < count:
        raise FormatError(f"the OFF file is truncated: it has {len(lines)} of {count} vertices")
    if not count:
        return np.empty((0, 3))
    values = parse_numbers(b"\n".join(lines))
    if len(values) % count or len(values) < 3 * count:
        raise FormatError("not all vertices have three coordinates")
    return values.reshape(count, -1)[:, :3]
