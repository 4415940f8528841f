"""Reads files of triangles: STL, and by trimesh PLY, OBJ, OFF and 3MF."""

from __future__ import annotations

import io
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.errors import InputError
from damageest.io.files import raise_environment_fault, shorten_error

MESH_SUFFIXES = (".stl", ".ply", ".obj", ".off", ".3mf")


def read_triangles(path: Path, suffix: str) -> tuple[Floats, Ints, str | None]:
    """What `damageest.io.meshes.read_mesh` gives of a file that has triangles alone, or is not valid."""
    if suffix == ".stl":
        vertices, faces = _read_stl(path)
        return vertices, faces, None
    if suffix == ".3mf":
        from damageest.io.three_mf_limits import check_archive

        check_archive(path)
    import trimesh

    try:
        options: dict[str, Any] = {"maintain_order": True} if suffix == ".obj" else {}
        if suffix in (".ply", ".3mf"):
            stream = _open_ply(path) if suffix == ".ply" else _open_3mf(path)
            scene = trimesh.load_scene(stream, file_type=suffix[1:], process=False)
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
            "swapped? For an earlier scan: part: {use: earlier_scan, path: ...}"
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


USUAL_MODEL = "3D/3dmodel.model"
"""Where trimesh looks for the model of a 3MF file; its relationships may name another place (ECMA-376, part 2)."""


def _open_3mf(path: Path) -> io.BytesIO:
    """A 3MF file whose model is where trimesh looks for it."""
    from lxml import etree

    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        if not any(USUAL_MODEL.lower() in name.lower() for name in names) and "_rels/.rels" in names:
            parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
            tree = etree.fromstring(archive.read("_rels/.rels"), parser)
            targets = [one.get("Target", "") for one in tree if str(one.get("Type", "")).endswith("/3dmodel")]
            place = targets[0].lstrip("/") if targets else ""
            if place in names:
                stream = io.BytesIO()
                with zipfile.ZipFile(stream, "w") as other:
                    other.writestr(USUAL_MODEL, archive.read(place))
                return io.BytesIO(stream.getvalue())
    return io.BytesIO(path.read_bytes())


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
    # a name may have any word
    words = re.sub(rb"(?:^|(?<=[\r\n]))[ \t]*((?:end)?solid)\b[^\n\r]*", rb"\1", data.lower())
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
