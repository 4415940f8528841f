"""The corners of the faces of OBJ, OFF and PLY files: the numbers of their vertices."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from damageest.artefacts import Ints
from damageest.errors import InputError
from damageest.io.points.ply_header import Element, Header
from damageest.io.points.ply_lists import walk_lists

_OBJ_FACE = re.compile(rb"^[ \t]*fo?[ \t]+([^\n#]*)", re.MULTILINE)
_OBJ_VERTEX = re.compile(rb"^[ \t]*v[ \t]", re.MULTILINE)
CORNERS = ("vertex_indices", "vertex_index")
"""Names of the list of a face's vertices in a PLY file."""


def list_obj_corners(path: Path, data: bytes) -> Iterable[Ints]:
    """The corners (C,) of all faces in the text of an OBJ file, in one piece. Raises as `read_obj_corners`."""
    yield read_obj_corners(path, join_obj_lines(data))[0]


def list_off_corners(path: Path, lines: list[bytes], expected: int) -> Iterable[Ints]:
    """The corners (C,) of all faces of an OFF file, in one piece. Raises as `read_off_corners`."""
    yield read_off_corners(path, lines, expected)[0]


def list_ply_corners(path: Path, header: Header) -> Iterable[Ints]:
    """The corners of the faces of a PLY file in pieces; none where it has no faces."""
    for element, name in find_faces(header):
        yield from walk_lists(path, header, element, name)


def find_faces(header: Header) -> Iterable[tuple[Element, str]]:
    """The elements of a PLY file that are faces, with the name of the list of their vertices."""
    for element in header.elements:
        name = next((one.name for one in element.lists if one.name in CORNERS), None)
        if element.name in ("face", "tristrips") and name is not None:
            yield element, name


def join_obj_lines(data: bytes) -> bytes:
    """The text of an OBJ file with one end of line, and lines that a backslash continues as one."""
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")


def read_obj_corners(path: Path, data: bytes) -> tuple[Ints, Ints]:
    """The corners (C,) of all faces in the text of an OBJ file, and how many (F,) each has. Raises InputError for a
    face with vertex 0."""
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
    return corners, count


def read_off_corners(path: Path, lines: list[bytes], expected: int) -> tuple[Ints, Ints]:
    """The corners (C,) of all faces of an OFF file, and how many (F,) each has, from the lines after its vertices and
    the number of faces that it says. Raises InputError where some are cut off."""
    rows = [row.split() for row in lines[:expected]]
    count = np.array([int(row[0]) for row in rows], np.int64)
    if len(rows) < expected or any(len(row) <= int(row[0]) for row in rows):
        raise InputError(f"{path}: the OFF file is truncated: it has {len(rows)} of {expected} whole faces")
    corners = np.array([word for row in rows for word in row[1 : int(row[0]) + 1]], "S").astype(np.int64)
    return corners, count
