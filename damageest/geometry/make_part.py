"""From vertices and faces, wherever they came from, to a `Part`."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from damageest.artefacts import Ints, Part, open_edges
from damageest.errors import InputError
from damageest.geometry.healing import heal


def make_part(
    vertices: ArrayLike,
    faces: ArrayLike,
    unit: str = "mm",
    *,
    path: str = "",
    sha256: str = "",
    repair: bool = True,
    faces_brep: Ints | None = None,
    face_names: tuple[str, ...] = (),
    face_kinds: tuple[str, ...] = (),
    tessellation_error: float = 0.0,
    notes: tuple[str, ...] = (),
) -> Part:
    """A part from vertices (V,3), already in ``unit``, and faces (F,3), repaired where that is safe.

    A repair that changes the triangles loses ``faces_brep``, which then would name the wrong ones. Raises InputError,
    naming ``path``, for a mesh that is not a solid and cannot safely be made one.
    """
    name = path or "the part"
    try:
        v, f = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)
        if v.ndim != 2 or f.ndim != 2 or v.shape[1] != 3 or f.shape[1] != 3:
            raise ValueError(f"expected vertices (V,3) and faces (F,3), got {v.shape} and {f.shape}")
        if len(f) and (f.min() < 0 or f.max() >= len(v)):
            raise ValueError(f"a face refers to a vertex outside the {len(v)} there are")
    except (ValueError, TypeError) as error:
        raise InputError(f"{name}: {error}") from None
    try:
        if repair:
            given = f
            v, f, made = heal(v, f)
            notes = (*notes, *made)
            if faces_brep is not None and not np.array_equal(given, f):
                faces_brep, face_names, face_kinds = None, (), ()
                notes = (*notes, "the repair changed the triangles: which CAD face each came from is no longer known")
        elif open_edges(f):
            raise InputError("not watertight, and 'repair' is off; set repair: true, or export the part as a solid")
        return Part(v, f, unit, path, sha256, faces_brep, face_names, face_kinds, tessellation_error, notes)
    except (InputError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None
