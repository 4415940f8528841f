"""Vertices of a mesh that belong to none of its faces. Programs leave them where faces were deleted, or add them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from damageest.artefacts import Ints
from damageest.errors import InputError
from damageest.io.points import PointFile

MOST, FEWEST = 0.75, 100
"""Share of loose vertices up to which they are no part of the scan, and vertices in faces at least. Where more are
loose, or few are in faces, the file holds points, and some faces beside them."""


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
    if not loose or loose > MOST * count or count - loose < FEWEST:
        return file
    note = f"{loose:,} of {count:,} vertices belong to no face of the mesh: they are left out"
    return replace(file.take(is_used), notes=(*file.notes, note))
