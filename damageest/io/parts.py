"""Reads a part from a mesh file."""

from __future__ import annotations

from pathlib import Path

from damageest.artefacts import Part
from damageest.errors import InputError
from damageest.geometry.make_part import make_part
from damageest.geometry.units import canonical_unit, unit_factor
from damageest.io.files import check_file, file_sha256
from damageest.io.meshes import read_noted_mesh
from damageest.io.triangles import MESH_SUFFIXES


def read_part(path: Path, unit: str, source: str | None = None, repair: bool = True) -> Part:
    """The part in a mesh file, in ``unit``.

    ``source``: unit of the lengths in the file; None: the unit that the file states, else ``unit``. Raises InputError
    if the file is not a solid and cannot be repaired to one.
    """
    check_file(path, MESH_SUFFIXES, "a part")
    vertices, faces, own, notes = read_noted_mesh(path)
    try:
        source = source or (canonical_unit(own) if own else unit)
    except InputError as error:
        raise InputError(f"{path}: {error}; set part.unit") from None
    if canonical_unit(source) != canonical_unit(unit):
        vertices = vertices * unit_factor(source, unit)
        notes = (
            *notes,
            f"converted from {canonical_unit(source)} to {canonical_unit(unit)}",
        )
    return make_part(vertices, faces, unit, path=str(path), sha256=file_sha256(path), repair=repair, notes=notes)
