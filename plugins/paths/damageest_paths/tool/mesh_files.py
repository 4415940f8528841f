"""Meshes that a job names for the nozzle and for what it must not touch."""

from __future__ import annotations

from pathlib import Path

from damageest.artefacts import Mesh
from damageest.errors import StageError

CLOSED = "nozzle"
"""What has to be a solid."""


def read_mesh_file(path: Path, what: str) -> Mesh:
    """A mesh from a file, for a nozzle or a fixture. Raises StageError where it cannot be read, or where a nozzle is
    not closed."""
    from damageest.artefacts import open_edges
    from damageest.geometry.duplicates import find_duplicates
    from damageest.io.meshes import read_mesh

    try:
        vertices, faces, _ = read_mesh(path)
        keep, number = find_duplicates(vertices)
        mesh = Mesh(vertices[keep], number[faces])
    except Exception as error:
        raise StageError(f"{what}: {path.name} cannot be read: {error}", "give an STL, PLY or OBJ file") from error
    if not len(mesh.faces) or (what == CLOSED and open_edges(mesh.faces)):
        raise StageError(f"{what}: {path.name} is {'not closed' if len(mesh.faces) else 'empty'}", "give a closed mesh")
    return mesh


def find_mesh_fault(path: Path | None, what: str, *more: str) -> list[tuple[tuple[str | int, ...], str]]:
    """The fault of a mesh that cannot be used, with its place among the options: ``what`` and ``more``. That there is
    no file is said by the job's own check."""
    if path is None or not path.is_file():
        return []
    try:
        read_mesh_file(path, what)
    except StageError as error:
        return [((what, *more), f"{error.message}; {error.remedy}")]
    return []
