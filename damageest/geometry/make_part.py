"""A `Part` from vertices and faces, as a file or a program gives them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from damageest.artefacts import Ints, Mesh, Part, open_edges
from damageest.errors import InputError
from damageest.geometry.face_labels import carry_labels
from damageest.geometry.healing import heal
from damageest.geometry.units import FARTHEST

SMALLEST = 1e-9
"""Least size of a part, in any unit: the powers of smaller ones would leave the range of numbers."""


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
    cad_scale: float = 0.0,
) -> Part:
    """A part from vertices (V,3) and faces (F,3), with safe repairs (see `damageest.geometry.healing`).

    Args:
        vertices: (V,3) in ``unit``, in the frame that becomes the part's.
        faces: (F,3), whose triangles may be in any order and face inward.
        unit: name of the unit of length; it is noted, nothing is converted.
        path, sha256: the file that the part was read from, and its checksum, for messages and the report.
        repair: False refuses a mesh that is not watertight instead of repairing it.
        faces_brep: (F,) number of the CAD face of each triangle; a repair that divides triangles, as a union of bodies
            does, keeps it; dropped, with the two names below, where one adds a triangle that lies on none of them.
        face_names, face_kinds: what the CAD file calls these faces.
        tessellation_error: bound of the distance between CAD surface and triangles, in ``unit``.
        notes: what was converted before; the repairs are added.
        cad_scale: how many of ``unit`` are one length of the CAD file as read; 0 for a mesh.

    Raises InputError, which starts with ``path``, for a mesh that is not a solid and cannot safely be repaired.
    """
    name = path or "the part"
    try:
        v, f = np.asarray(vertices, dtype=np.float64), np.asarray(faces, dtype=np.int64)
        if v.ndim != 2 or f.ndim != 2 or v.shape[1] != 3 or f.shape[1] != 3:
            raise ValueError(f"expected vertices (V,3) and faces (F,3), got {v.shape} and {f.shape}")
        if len(f) and (f.min() < 0 or f.max() >= len(v)):
            raise ValueError(f"a face has an index outside the {len(v)} vertices")
        if len(v) and not np.nanmax(np.abs(v)) <= FARTHEST:
            raise ValueError(f"coordinates above {FARTHEST:g}, or none that are finite; export the part again")
        if len(v) and not np.ptp(v, axis=0).max() >= SMALLEST:
            raise ValueError(f"smaller than {SMALLEST:g} {unit}; export the part again")
    except (ValueError, TypeError) as error:
        raise InputError(f"{name}: {error}") from None
    try:
        if repair:
            given = Mesh(v, f) if faces_brep is not None and len(f) and np.isfinite(v).all() else None
            v, f, made = heal(v, f, tessellation_error, outward=faces_brep is not None)
            notes = (*notes, *made)
            if given is not None and faces_brep is not None and not np.array_equal(given.faces, f):
                faces_brep = carry_labels(v, f, given, faces_brep)
                if faces_brep is None:
                    face_names, face_kinds = (), ()
                    lost = "the repair changed the triangles: the CAD face of each triangle is no longer known"
                    notes = (*notes, lost)
        elif open_edges(f):
            raise InputError("not watertight, and 'repair' is off; set repair: true, or export the part as a solid")
        return Part(v, f, unit, path, sha256, faces_brep, face_names, face_kinds, tessellation_error, notes, cad_scale)
    except (InputError, ValueError) as error:
        raise InputError(f"{name}: {error}") from None
