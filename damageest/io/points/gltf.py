"""glTF 2.0, read by trimesh: .glb, and .gltf that holds its data itself. Lengths are metres, by its standard."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from damageest.io.points import FormatError, PointFile
from damageest.io.points.mesh import NOTE

PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression", "KHR_mesh_quantization")
"""Extensions that change how vertices are stored, and are not read."""
MOST_NODES = 10_000
"""Nodes of a scene at most."""


def read(path: Path, columns: str | None = None) -> PointFile:
    """The vertices of all meshes and point sets of the scene, each where its nodes place it, with colours."""
    _check(_read_json(path), path.stat().st_size)
    import trimesh

    scene = trimesh.load_scene(path, process=False, skip_materials=True)
    points, colours, is_mesh = [], [], False
    for node in scene.graph.nodes_geometry:
        T, name = scene.graph[node]
        body = scene.geometry[name]
        vertices = np.asarray(getattr(body, "vertices", np.empty((0, 3))), np.float64).reshape(-1, 3)
        points.append(vertices @ np.asarray(T)[:3, :3].T + np.asarray(T)[:3, 3])
        own = _find_colours(body, len(vertices))
        colours += [] if own is None else [own]
        is_mesh |= isinstance(body, trimesh.Trimesh)
    if not points:
        raise FormatError("the scene has no points or meshes")
    whole = len(colours) == len(points)
    return PointFile(
        np.concatenate(points),
        unit="m",
        notes=(NOTE,) if is_mesh else (),
        colours=np.concatenate(colours) if whole else None,
    )


def _read_json(path: Path) -> Any:
    """The description of the scene. Raises FormatError where there is none."""
    data = _read_first_chunk(path) if path.suffix.lower() == ".glb" else path.read_bytes()
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        raise FormatError("not a glTF file: its description is no JSON") from None
    if not isinstance(content, dict) or not isinstance(content.get("asset"), dict):
        raise FormatError("not a glTF file: it has no asset")
    return content


def _read_first_chunk(path: Path) -> bytes:
    """The description in a GLB file, without the data that follow it."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(20)
        if len(head) < 20 or head[:4] != b"glTF":
            raise FormatError("not a GLB file: it does not start with 'glTF'")
        version, length, first, kind = struct.unpack_from("<IIII", head, 4)
        if version != 2:
            raise FormatError(f"glTF {version} is not read; export glTF 2.0")
        if length > size or kind != 0x4E4F534A or 20 + first > size:
            raise FormatError(f"the GLB file is truncated: it has {size} of {length} bytes")
        return stream.read(first)


def _check(content: dict[str, Any], size: int) -> None:
    """Raises FormatError for what is not read, and for numbers that would fill the memory."""
    for name in PACKED:
        if name in (content.get("extensionsRequired") or ()):
            raise FormatError(f"its vertices are stored by {name}, which is not read; export without compression")
    for buffer in content.get("buffers") or ():
        uri = buffer.get("uri")
        if uri is not None and not str(uri).startswith("data:"):
            raise FormatError(f"its vertices are in another file, '{str(uri)[:60]}'; export GLB, which is one file")
        if not 0 <= int(buffer.get("byteLength", 0)) <= size:
            raise FormatError("the file is truncated: it is too small for its buffers")
    for accessor in content.get("accessors") or ():
        if not 0 <= int(accessor.get("count", 0)) <= size:
            raise FormatError("the file is truncated: it is too small for its vertices")
    if len(content.get("nodes") or ()) > MOST_NODES:
        raise FormatError(f"its scene has more than the {MOST_NODES} nodes that are read")


def _find_colours(body: Any, count: int) -> Any:
    """Colours (N,3) of the vertices of a body; None where it has none of its own."""
    visual = getattr(body, "visual", None)
    values = getattr(visual, "vertex_colors", None) if getattr(visual, "kind", None) == "vertex" else None
    if values is None and hasattr(body, "colors"):
        values = body.colors
    if values is None or np.shape(values)[:1] != (count,) or np.ndim(values) != 2:
        return None
    return np.ascontiguousarray(np.asarray(values)[:, :3], np.uint8)
