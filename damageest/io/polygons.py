"""Faces with more than three corners in OBJ, OFF and PLY files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.errors import InputError
from damageest.geometry.polygons import triangulate_polygons

_OBJ_FACE = re.compile(rb"^[ \t]*fo?[ \t]+([^\n#]*)", re.MULTILINE)
_OWN_OBJ = re.compile(rb"^[ \t]*fo?(?:(?:[ \t]+[^\s#]+){4}|(?:[ \t]+[^\s#]+){0,2}[ \t]+(?:-|0[\s/]))", re.MULTILINE)
"""A face of four corners, or by numbers that count backward or from 0, which trimesh takes from the end of the file."""
_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]", re.MULTILINE)

Polygons = tuple[Floats, Ints, Ints]
"""Vertices (V,3), the corners (C,) of all faces one after the other, and how many (F,) each face has."""


def read_polygons(path: Path, suffix: str, triangles: bool = False) -> tuple[Floats, Ints, str] | None:
    """Vertices (V,3), triangles (F,3) and a note on divided faces, empty where there are none; None for other formats,
    and, unless ``triangles``, for OBJ and PLY of triangles alone.

    Raises InputError for a face that refers to no vertex, FormatError for a file that is not in the format.
    """
    if suffix == ".obj" and not triangles and not _OWN_OBJ.search(path.read_bytes().replace(b"\\\n", b" ")):
        return None
    reader = {".obj": _read_obj, ".off": _read_off, ".ply": _read_ply}.get(suffix)
    found = reader(path) if reader else None
    if found is None or not (triangles or suffix in (".off", ".obj") or (found[2] > 3).any()):
        return None
    vertices, corners, count = found
    if len(corners) and (corners.min() < 0 or corners.max() >= len(vertices)):
        raise InputError(f"{path}: a face refers to a vertex that is not in the file; the file may be truncated")
    made = triangulate_polygons(vertices, corners, count)
    note = made.divided and (
        f"{made.divided:,} of {len(count):,} faces have more than three corners: they were divided into triangles"
        + (f", {made.concave:,} of them, which are concave, by ear clipping" if made.concave else "")
    )
    return vertices, made.faces, note or ""


def read_corners(path: Path) -> Ints:
    """The corners (C,) of all faces of an OBJ or OFF file. Raises FormatError or InputError where some are cut off."""
    found = {".obj": _read_obj, ".off": _read_off}[path.suffix.lower()](path)
    return np.empty(0, np.int64) if found is None else found[1]


def _read_obj(path: Path) -> Polygons | None:
    from damageest.io.points.mesh import read_obj_vertices

    data = path.read_bytes().replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
    rows = _OBJ_FACE.findall(data)
    count = np.array([len(row.split()) for row in rows], np.int64)
    corners = np.array(re.sub(rb"/\S*", b"", b" ".join(rows)).split(), "S").astype(np.int64)
    if not corners.all():
        raise InputError(f"{path}: a face has the vertex 0, but OBJ counts from 1; export the file again")
    relative = corners < 0
    if relative.any():  # they count from the last vertex in front of the face
        faces = np.array([match.start() for match in _OBJ_FACE.finditer(data)])
        known = np.searchsorted([match.start() for match in _OBJ_VERTEX.finditer(data)], faces)
        corners = np.where(relative, corners + np.repeat(known, count), corners - 1)
    else:
        corners = corners - 1
    return read_obj_vertices(data)[:, :3], corners, count


def _read_off(path: Path) -> Polygons | None:
    from damageest.io.points.mesh import read_off_rows

    vertices, faces, expected, _ = read_off_rows(path)
    rows = [row.split() for row in faces[:expected]]
    count = np.array([int(row[0]) for row in rows], np.int64)
    if len(rows) < expected or any(len(row) <= int(row[0]) for row in rows):
        raise InputError(f"{path}: the OFF file is truncated: it has {len(rows)} of {expected} whole faces")
    corners = np.array([word for row in rows for word in row[1 : int(row[0]) + 1]], "S").astype(np.int64)
    return vertices[:, :3], corners, count


def _read_ply(path: Path) -> Polygons | None:
    from damageest.io.points.loose import CORNERS
    from damageest.io.points.ply import read_vertices
    from damageest.io.points.ply_header import read_header
    from damageest.io.points.ply_lists import read_lists

    header = read_header(path)
    for element in header.elements:
        names = [one.name for one in element.lists]
        name = next((one for one in names if one in CORNERS), None)
        if element.name in ("face", "tristrips") and name is not None:
            corners, count = read_lists(path, header, element, name)
            if element.name == "tristrips":
                corners = _divide_strips(corners, count)
                count = np.full(len(corners) // 3, 3)
            return read_vertices(path, header).points, corners, count
    return None


def _divide_strips(corners: Ints, count: Ints) -> Ints:
    """The corners of the triangles of strips, one after the other; -1 begins another strip. Every second triangle of a
    strip is turned over."""
    ends = np.zeros(len(corners), bool)
    ends[np.cumsum(count)[count > 0] - 1] = True
    begin = np.concatenate([[True], (ends | (corners < 0))[:-1]])
    place = np.arange(len(corners))
    first = np.maximum.accumulate(np.where(begin, place, 0))
    third = place[(place - first >= 2) & (corners >= 0)]
    turned = (third - first[third]) % 2 == 1
    a, b = np.where(turned, third - 1, third - 2), np.where(turned, third - 2, third - 1)
    return np.asarray(corners[np.column_stack([a, b, third])].ravel())
