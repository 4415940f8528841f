"""Reads triangle meshes; writes triangle meshes and point clouds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh
from damageest.errors import InputError
from damageest.geometry.vectors import normalise
from damageest.io.file_memory import require_memory_for
from damageest.io.files import check_file, raise_environment_fault
from damageest.io.polygons import read_polygons
from damageest.io.triangles import MESH_SUFFIXES, STL_TRIANGLE, read_triangles
from damageest.isolation.memory import FEWER_POINTS, require_memory


def read_mesh(path: Path) -> tuple[Floats, Ints, str | None]:
    """Vertices (V,3) and faces (F,3) of all bodies in a mesh file, and the file's unit, or None if it states none.

    Bodies are moved to their positions in the scene. Faces of more than three corners are divided; nothing is merged or
    repaired. Raises InputError, which names the file, if it is not a mesh in the format of its suffix, or if it is
    truncated.
    """
    return read_noted_mesh(path)[:3]


def read_noted_mesh(path: Path) -> tuple[Floats, Ints, str | None, tuple[str, ...]]:
    """The same, and notes on changes of the faces."""
    suffix = check_file(path, MESH_SUFFIXES, "a mesh")
    require_memory_for([path])
    if (divided := _divide(path, suffix)) is not None:
        return divided
    try:
        return *read_triangles(path, suffix), ()
    except InputError:  # such as of a PLY with lists besides the corners, which trimesh does not read
        if (divided := _divide(path, suffix, triangles=True)) is not None:
            return divided
        raise


def _divide(path: Path, suffix: str, triangles: bool = False) -> tuple[Floats, Ints, None, tuple[str, ...]] | None:
    """What `read_polygons` gives; None also for what is not valid, of which trimesh says more."""
    try:
        found = read_polygons(path, suffix, triangles)
    except Exception as error:
        raise_environment_fault(error)
        return None
    return None if found is None or not len(found[1]) else (found[0], found[1], None, (found[2],) if found[2] else ())


PLY_TYPES = {"f8": "double", "f4": "float", "u1": "uchar", "i4": "int"}
"""numpy's types as PLY names them."""


def _describe_columns(columns: Mapping[str, NDArray[Any]]) -> tuple[list[tuple[str, np.dtype[Any]]], str]:
    """The fields of a record with these columns, little-endian, and the lines of a PLY header for them."""
    fields = [(name, values.dtype.newbyteorder("<")) for name, values in columns.items()]
    return fields, "".join(f"property {PLY_TYPES[v.dtype.str[1:]]} {name}\n" for name, v in columns.items())


def write_ply(path: Path, mesh: Mesh, columns: Mapping[str, NDArray[Any]] | None = None) -> None:
    """Writes a mesh as binary little-endian PLY with coordinates in double precision.

    ``columns``: properties of the faces, each (F,), in the type of the column.
    """
    columns = columns or {}
    more, listed = _describe_columns(columns)
    table = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3), *more])
    table["count"], table["corners"] = 3, mesh.faces
    for name, values in columns.items():
        table[name] = values
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\n{listed}end_header\n"
    )
    path.write_bytes(head.encode() + mesh.vertices.astype("<f8").tobytes() + table.tobytes())


def write_points(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    """Writes points as binary little-endian PLY, with one property per column (N,), in the type of the column."""
    fields, listed = _describe_columns(columns)
    count = len(next(iter(columns.values())))
    require_memory(2 * np.dtype(fields).itemsize * count, f"writing {count:,} points", FEWER_POINTS)
    table = np.empty(count, fields)
    for name, values in columns.items():
        table[name] = values
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n{listed}end_header\n"
    _write(path, head.encode(), table)


def _write(path: Path, head: bytes, table: NDArray[Any]) -> None:
    """Writes without a copy of the table."""
    with path.open("wb") as stream:
        stream.write(head)
        stream.write(table.view(np.uint8).data)


def write_stl(path: Path, mesh: Mesh) -> None:
    """Writes a mesh as binary STL, with coordinates in single precision and no date in its header."""
    corners = mesh.triangles.astype(np.float32)
    a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    table = np.zeros(len(corners), STL_TRIANGLE)
    table["normal"] = normalise(normal)
    table["corners"] = corners
    _write(path, b"damageest".ljust(80, b"\0") + len(table).to_bytes(4, "little"), table)
