"""Faces with more than three corners in OBJ, OFF and PLY files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.errors import InputError
from damageest.geometry.polygons import triangulate_polygons
from damageest.io.points.corners import find_faces, join_obj_lines, read_obj_corners, read_off_corners

_OWN_OBJ = re.compile(rb"^[ \t]*fo?(?:(?:[ \t]+[^\s#]+){4}|(?:[ \t]+[^\s#]+){0,2}[ \t]+(?:-|0[\s/]))", re.MULTILINE)
"""A face of four corners, or by numbers that count backward or from 0, which trimesh takes from the end of the file."""

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


def _read_obj(path: Path) -> Polygons:
    from damageest.io.points.mesh import read_obj_vertices

    data = join_obj_lines(path.read_bytes())
    return read_obj_vertices(data)[:, :3], *read_obj_corners(path, data)


def _read_off(path: Path) -> Polygons:
    from damageest.io.points.off import read_off_rows

    vertices, faces, expected, _ = read_off_rows(path)
    return vertices[:, :3], *read_off_corners(path, faces, expected)


def _read_ply(path: Path) -> Polygons | None:
    from damageest.io.points.ply import read_vertices
    from damageest.io.points.ply_header import read_header
    from damageest.io.points.ply_lists import read_lists

    header = read_header(path)
    for element, name in find_faces(header):
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
