"""Scans that were meshed: the vertices of STL, OBJ and OFF files, each once."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.duplicates import find_duplicates
from damageest.io.meshes import read_stl_corners
from damageest.io.points import FormatError, PointFile
from damageest.io.points.text import numbers


def read(path: Path, columns: str | None = None) -> PointFile:
    """The mesh's vertices; its triangles are not used."""
    points = {".stl": _stl, ".obj": _obj, ".off": _off}[path.suffix.lower()](path)
    return PointFile(points, notes=("a mesh: its vertices are taken as the scan's points",))


def _stl(path: Path) -> Floats:
    corners = read_stl_corners(path).reshape(-1, 3)
    return corners[find_duplicates(corners)[0]]


def _obj(path: Path) -> Floats:
    rows = re.findall(rb"^[ \t]*v[ \t]+([^\n#]*)", path.read_bytes(), re.MULTILINE)
    if not rows:
        raise FormatError("holds no vertices ('v x y z')")
    width = len(rows[0].split())
    values = numbers(b" ".join(rows))
    if width < 3 or len(values) != width * len(rows):
        raise FormatError("not all of its vertices have three coordinates; the file may be cut short")
    return values.reshape(-1, width)[:, :3]


def _off(path: Path) -> Floats:
    data = re.sub(rb"#[^\n]*", b"", path.read_bytes()).replace(b"\r", b"\n").strip()
    start = re.match(rb"(ST)?(C)?(N)?OFF\s+(\d+)\s+(\d+)(\s+\d+)?[ \t]*\n", data)
    if not start:
        raise FormatError("not a text OFF file")
    count = int(start.group(4))
    lines = [line for line in data[start.end() :].split(b"\n") if line.strip()][:count]
    if len(lines) < count:
        raise FormatError(f"the OFF file is cut short: {len(lines)} of {count} vertices are there")
    if not count:
        return np.empty((0, 3))
    values = numbers(b"\n".join(lines))
    if len(values) % count or len(values) < 3 * count:
        raise FormatError("not all of its vertices have three coordinates")
    return values.reshape(count, -1)[:, :3]
