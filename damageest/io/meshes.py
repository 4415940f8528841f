"""Reads triangle meshes; writes triangle meshes and point clouds."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh
from damageest.errors import InputError
from damageest.geometry.vectors import normalise
from damageest.io.file_memory import require_memory_for
from damageest.io.files import check_file, raise_environment_fault, shorten_error
from damageest.isolation.memory import FEWER_POINTS, require_memory

MESH_SUFFIXES = (".stl", ".ply", ".obj", ".off", ".3mf")


def read_mesh(path: Path) -> tuple[Floats, Ints, str | None]:
    """Vertices (V,3) and faces (F,3) of all bodies in a mesh file, and the file's unit, or None if it states none.

    Bodies are moved to their positions in the scene. Nothing is merged or repaired. Raises InputError, which names the
    file, if it is not a mesh in the format of its suffix, or if it is truncated.
    """
    suffix = check_file(path, MESH_SUFFIXES, "a mesh")
    require_memory_for([path])
    if suffix == ".stl":
        vertices, faces = _read_stl(path)
        return vertices, faces, None
    if suffix == ".3mf":
        from damageest.io.three_mf_limits import check_archive

        check_archive(path)
    import trimesh

    try:
        options: dict[str, Any] = {"maintain_order": True} if suffix == ".obj" else {}
        if suffix == ".ply":
            scene = trimesh.load_scene(_open_ply(path), file_type="ply", process=False)
        else:
            scene = trimesh.load_scene(path, process=False, **options)
        placed = [(*scene.graph[node],) for node in scene.graph.nodes_geometry]
        bodies = [(scene.geometry[name], np.asarray(T, dtype=np.float64)) for T, name in placed]
        meshes = [
            (np.asarray(g.vertices, dtype=np.float64) @ T[:3, :3].T + T[:3, 3], np.asarray(g.faces, dtype=np.int64))
            for g, T in bodies
            if isinstance(g, trimesh.Trimesh) and len(g.faces)
        ]
        unit = str(scene.units) if suffix == ".3mf" and scene.units else None
    except Exception as error:
        raise_environment_fault(error)
        raise InputError(f"{path}: cannot be read as a {suffix} mesh ({shorten_error(error)})") from None
    if not meshes:
        raise InputError(
            f"{path}: the file has no triangles; a part must be a closed mesh. Are part and scan "
            "swapped? Of an earlier scan in place of the part:  part: {use: earlier_scan, path: ...}"
        )
    vertices, faces = trimesh.util.append_faces(*zip(*meshes, strict=True))
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path}: a triangle refers to a vertex that is not in the file; the file may be truncated")
    return vertices, faces, unit


def _open_ply(path: Path) -> io.BytesIO:
    """A PLY file without the comments in front of its format, which are valid, but which trimesh does not expect."""
    data = path.read_bytes()
    start, found, rest = data[: 1 << 16].partition(b"format ")
    lines = start.splitlines(keepends=True)
    if found and all(line.startswith((b"comment", b"obj_info")) or not line.strip() for line in lines[1:]):
        data = lines[0] + found + rest + data[1 << 16 :]
    return io.BytesIO(data)


STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_stl_corners(path: Path) -> Floats:
    """Corners (F,3,3) of the triangles in a binary or text STL file. Raises InputError if the file is not complete."""
    data = path.read_bytes()
    if len(data) >= 84:
        count = int.from_bytes(data[80:84], "little")
        if len(data) >= 84 + count * 50 and (count or not data.lstrip().startswith(b"solid")):
            found = np.frombuffer(data, STL_TRIANGLE, count, 84)
            if not count:
                raise InputError(f"{path}: the STL file has no triangles")
            return found["corners"].astype(np.float64)
    if not data.lstrip()[:5].lower() == b"solid":
        raise InputError(
            f"{path}: not an STL file, or truncated: {len(data)} bytes are too few for the triangles in its header"
        )
    words = data.lower()
    corners = words.count(b"vertex")
    if not corners or corners % 3 or words.count(b"facet") % 2 or b"endsolid" not in words[-4096:]:
        raise InputError(f"{path}: a text STL file with incomplete triangles; the file may be truncated")
    pieces = words.split(b"vertex")[1:]
    try:
        numbers = np.array([piece.split(None, 3)[:3] for piece in pieces], dtype="S32").astype(np.float64)
    except (ValueError, IndexError):
        raise InputError(f"{path}: a text STL file with vertices that are not numbers") from None
    return numbers.reshape(-1, 3, 3)


def _read_stl(path: Path) -> tuple[Floats, Ints]:
    corners = read_stl_corners(path)
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int64).reshape(-1, 3)


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
