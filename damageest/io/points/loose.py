"""Vertices of a mesh that belong to none of its faces. Programs leave them where faces were deleted, or add them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from damageest.artefacts import Ints
from damageest.errors import InputError
from damageest.io.points import PointFile
from damageest.io.points.ply_header import Header
from damageest.io.points.ply_lists import walk_lists

MOST = 0.75
"""Share of loose vertices up to which they are no part of the scan. Where more are loose, the file holds points, and
some faces beside them."""
CORNERS = ("vertex_indices", "vertex_index")
"""Names of the list of a face's vertices in a PLY file."""


def drop_loose(file: PointFile, corners: Iterable[Ints]) -> PointFile:
    """The file without the vertices that none of the ``corners`` (C,) of its faces, given in pieces, refers to. The
    same where it has no faces, or they are not whole, or most vertices are loose; a note says how many are left out."""
    count = len(file.points)
    is_used = np.zeros(count, bool)
    try:
        for piece in corners:
            is_used[piece[(piece >= 0) & (piece < count)]] = True
    except (ValueError, InputError):
        return file
    loose = count - int(is_used.sum())
    if not loose or loose > MOST * count:
        return file
    note = f"{loose:,} of {count:,} vertices belong to no face of the mesh: they are left out"
    return replace(file.take(is_used), notes=(*file.notes, note))


def list_ply_corners(path: Path, header: Header) -> Iterable[Ints]:
    """The corners of the faces of a PLY file in pieces; none where it has no faces."""
    for element in header.elements:
        name = next((one.name for one in element.lists if one.name in CORNERS), None)
        if element.name in ("face", "tristrips") and name is not None and element.count:
            yield from walk_lists(path, header, element, name)


def list_corners(path: Path) -> Iterable[Ints]:
    """The corners of the faces of an OBJ or OFF file; none where it has no faces."""
    from damageest.io.polygons import read_corners

    yield read_corners(path)
