"""Reading and writing triangle meshes and point clouds, the formats and nothing else."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints, Mesh, Solid, open_edges
from damageest.errors import InputError

MESH_SUFFIXES = (".stl", ".ply", ".obj", ".off", ".3mf")


def checked_file(path: Path, suffixes: tuple[str, ...], what: str) -> str:
    """The file's suffix in lower case. Raises InputError where it is missing, empty or not of ``suffixes``."""
    valid = f"{what} may be: {', '.join(suffixes)}"
    if path.is_dir():
        raise InputError(f"{path}: is a folder, not a file; {valid}")
    if not path.is_file():
        raise InputError(f"{path}: no such file; {valid}")
    suffix = path.suffix.lower()
    if suffix not in suffixes:
        raise InputError(f"{path}: '{suffix}' is not a suffix that can be read here; {valid}")
    try:
        with path.open("rb") as stream:
            start = stream.read(64)
    except OSError as error:
        raise InputError(f"{path}: cannot be opened: {error.strerror or error}") from None
    if not start:
        raise InputError(f"{path}: the file is empty; {valid}")
    if start.lstrip().lower().startswith((b"<!doctype html", b"<html")):
        raise InputError(f"{path}: holds a web page, not {what}; {valid}")
    return suffix


def sha256(path: Path) -> str:
    """The file's SHA-256, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def read_mesh(path: Path) -> tuple[Floats, Ints, str | None]:
    """Vertices (V,3) and faces (F,3) of all bodies in a mesh file, and the file's own unit where it has one.

    Instances of a scene are placed; nothing is merged or repaired. Raises InputError, naming the file, where it is
    not a mesh of its kind or is cut short.
    """
    suffix = checked_file(path, MESH_SUFFIXES, "a mesh")
    if suffix == ".stl":
        vertices, faces = _read_stl(path)
        return vertices, faces, None
    import trimesh

    try:
        scene = trimesh.load_scene(path, process=False, **({"maintain_order": True} if suffix == ".obj" else {}))
        placed = [(*scene.graph[node],) for node in scene.graph.nodes_geometry]
        bodies = [(scene.geometry[name], np.asarray(T, dtype=np.float64)) for T, name in placed]
        meshes = [
            (np.asarray(g.vertices, dtype=np.float64) @ T[:3, :3].T + T[:3, 3], np.asarray(g.faces, dtype=np.int64))
            for g, T in bodies
            if isinstance(g, trimesh.Trimesh)
        ]
        unit = str(scene.units) if suffix == ".3mf" and scene.units else None
    except Exception as error:
        raise InputError(f"{path}: not a readable {suffix} mesh ({reason(error)})") from None
    sizes = np.cumsum([0] + [len(v) for v, _ in meshes])
    vertices = np.concatenate([v for v, _ in meshes]) if meshes else np.empty((0, 3))
    faces = (
        np.concatenate([f + s for (_, f), s in zip(meshes, sizes[:-1], strict=True)])
        if meshes
        else np.empty((0, 3), np.int64)
    )
    if not len(faces):
        raise InputError(f"{path}: holds no triangles; a part must be a closed mesh")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(f"{path}: a triangle refers to a vertex that the file lacks; it may be cut short")
    return vertices, faces, unit


STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def stl_corners(path: Path) -> Floats:
    """(F,3,3) the triangles' corners of an STL file, binary or text. Raises InputError."""
    data = path.read_bytes()
    if len(data) >= 84:
        count = int.from_bytes(data[80:84], "little")
        if len(data) >= 84 + count * 50 and (count or not data.lstrip().startswith(b"solid")):
            found = np.frombuffer(data, STL_TRIANGLE, count, 84)
            if not count:
                raise InputError(f"{path}: the STL file holds no triangles")
            return found["corners"].astype(np.float64)
    if not data.lstrip()[:5].lower() == b"solid":
        raise InputError(
            f"{path}: not an STL file, or one cut short: {len(data)} bytes do not hold what its header says"
        )
    words = data.lower()
    corners = words.count(b"vertex")
    if not corners or corners % 3 or words.count(b"facet") % 2 or b"endsolid" not in words[-4096:]:
        raise InputError(f"{path}: a text STL file without whole triangles, or one cut short")
    pieces = words.split(b"vertex")[1:]
    try:
        numbers = np.array([piece.split(None, 3)[:3] for piece in pieces], dtype="S32").astype(np.float64)
    except (ValueError, IndexError):
        raise InputError(f"{path}: a text STL file whose vertices are not numbers") from None
    return numbers.reshape(-1, 3, 3)


def _read_stl(path: Path) -> tuple[Floats, Ints]:
    corners = stl_corners(path)
    return corners.reshape(-1, 3), np.arange(3 * len(corners), dtype=np.int64).reshape(-1, 3)


def reason(error: BaseException) -> str:
    """An error of a library in one line."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 160 else text[:157] + "..."


def first_of_equal(points: Floats) -> tuple[Ints, Ints]:
    """Exact duplicates among points (N,3): ``keep`` (M,), the index of each distinct point's first copy, rising, and
    ``inverse`` (N,), which of them each point equals.

    Sorts one 64-bit hash per point, far faster than sorting rows; points that share a hash are compared in full.
    """
    bits = (np.ascontiguousarray(points, dtype=np.float64) + 0.0).view(np.uint64)  # + 0.0 turns -0 into 0
    mixed = np.zeros(len(points), np.uint64)
    with np.errstate(over="ignore"):
        for column, odd in zip(bits.T, (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9), strict=True):
            mixed = (mixed ^ (column >> np.uint64(29)) ^ column) * np.uint64(odd)
            mixed ^= mixed >> np.uint64(32)
    ordered = np.sort(mixed)
    if not (ordered[1:] == ordered[:-1]).any():
        every = np.arange(len(points))
        return every, every
    order = np.argsort(mixed, kind="stable")
    same = (mixed[order][1:] == mixed[order][:-1]) & (bits[order][1:] == bits[order][:-1]).all(1)
    # two distinct points under one hash may interleave their copies: then rows themselves are sorted
    clash = (mixed[order][1:] == mixed[order][:-1]) & ~same
    if clash.any():
        _, first, inverse = np.unique(bits, axis=0, return_index=True, return_inverse=True)
        rank = np.argsort(np.argsort(first))
        return np.sort(first), rank[inverse.reshape(-1)]
    group = np.concatenate([[0], np.cumsum(~same)])
    first = order[np.concatenate([[True], ~same])]
    rank = np.empty(len(first), np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    inverse = np.empty(len(points), np.int64)
    inverse[order] = rank[group]
    return np.sort(first), inverse


def write_ply(path: Path, mesh: Mesh) -> None:
    """A mesh as binary little-endian PLY with coordinates in double precision."""
    table = np.empty(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    table["count"], table["corners"] = 3, mesh.faces
    head = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(mesh.faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(head.encode() + mesh.vertices.astype("<f8").tobytes() + table.tobytes())


def write_points(path: Path, columns: dict[str, NDArray[Any]]) -> None:
    """Points as binary little-endian PLY, one property per column (N,), in the columns' own types."""
    names = {"f8": "double", "f4": "float", "u1": "uchar", "i4": "int"}
    kind = np.dtype([(name, values.dtype.newbyteorder("<")) for name, values in columns.items()])
    table = np.empty(len(next(iter(columns.values()))), kind)
    for name, values in columns.items():
        table[name] = values
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(table)}\n"
    head += "".join(f"property {names[values.dtype.str[1:]]} {name}\n" for name, values in columns.items())
    path.write_bytes(head.encode() + b"end_header\n" + table.tobytes())


def write_stl(path: Path, mesh: Mesh) -> None:
    """A mesh as binary STL, whose coordinates are single precision; see `single_precision`. No date in its header."""
    corners = mesh.triangles.astype(np.float32)
    a, b, c = np.moveaxis(corners.astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    table = np.zeros(len(corners), STL_TRIANGLE)
    table["normal"] = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    table["corners"] = corners
    path.write_bytes(b"damageest".ljust(80, b"\0") + len(table).to_bytes(4, "little") + table.tobytes())


def single_precision(solid: Solid, mend: bool = True) -> Solid | None:
    """The solid with coordinates that single precision holds, watertight even where equal vertices count as one.

    Rounding can bring vertices together: the triangles that vanish are taken out. Where that opens the mesh, its
    smallest details are collapsed first, up to 64 times the rounding, if it is to ``mend``. None where even then it
    does not close.
    """
    for steps in (0, 2, 8, 64) if mend else (0,):
        mesh: Mesh = solid
        if steps:
            mesh = _simplified(solid, steps * float(np.spacing(np.float32(np.abs(solid.vertices).max()))))
        rounded = mesh.vertices.astype(np.float32).astype(np.float64)
        keep, inverse = first_of_equal(rounded)
        faces = inverse[mesh.faces]
        a, b, c = faces.T
        faces = faces[(a != b) & (b != c) & (c != a)]
        if len(faces) and not open_edges(faces):
            try:
                return Solid(rounded[keep], faces)
            except ValueError:  # nothing but rounding is left of its volume
                return None
    return None


def _simplified(solid: Solid, size: float) -> Mesh:
    """The solid without details below ``size``."""
    from damageest.solids import to_arrays, to_manifold

    origin = solid.bounds.mean(0)
    try:
        return Mesh(*to_arrays(to_manifold(solid, origin).simplify(size), origin))
    except ValueError:
        return solid
