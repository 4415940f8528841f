"""Scans as meshes, as scanners' programs make them: with holes, edges of three triangles, in VTK and glTF scenes."""

from __future__ import annotations

import json
import struct
from base64 import b64encode
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import damageest
from damageest.errors import InputError
from damageest.io.points import read_points
from damageest.stages.scan.file import ScanFile
from tests import damaged_box

RADIUS, DEPTH = 6.0, 3.0
"""Of the paraboloid that is lost."""
VTK = ("vtk", "vtp", "vtu")
PLACES = [trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [4, 5, 6]), trimesh.transformations.scale_matrix(2.0)]
PLACES[1][:3, 3] = 1, 2, 3


@cache
def sheets() -> trimesh.Trimesh:
    """A net of the damaged box with two holes, and edges that three triangles share."""
    grid = trimesh.creation.box(damaged_box.SIZE)
    for _ in range(6):
        grid = grid.subdivide()
    vertices = grid.vertices.copy()
    lost = DEPTH * (1 - (vertices[:, :2] ** 2).sum(axis=1) / RADIUS**2)
    vertices[:, 2] -= np.where((vertices[:, 2] == vertices[:, 2].max()) & (lost > 0), lost, 0)
    centre = grid.triangles_center
    holes = (np.abs(centre - [12, 8, 10]).max(axis=1) < 2) | (np.abs(centre - [-20, 0, 0]).max(axis=1) < 2)
    faces = grid.faces[~holes]
    fin = np.column_stack([faces[:50, 0], faces[:50, 1], faces[50:100, 2]])  # edges of three triangles
    return trimesh.Trimesh(vertices, np.concatenate([faces, fin]), process=False)


def save_vtk(path: Path, mesh: trimesh.Trimesh, binary: bool = True) -> Path:
    import pyvista

    data: Any = pyvista.make_tri_mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    data.point_data["quality"] = np.arange(len(mesh.vertices), dtype=np.float32)
    data.point_data["RGB"] = (np.arange(3 * len(mesh.vertices)) % 256).astype(np.uint8).reshape(-1, 3)
    data = data.cast_to_unstructured_grid() if path.suffix == ".vtu" else data
    data.save(path, binary=binary)
    return path


def save_scene(path: Path, mesh: trimesh.Trimesh) -> Path:
    """The mesh twice, by a node within a node."""
    scene = trimesh.Scene()
    scene.add_geometry(mesh, node_name="outer", geom_name="mesh", transform=PLACES[0])
    scene.add_geometry(mesh, node_name="inner", geom_name="again", parent_node_name="outer", transform=PLACES[1])
    data = scene.export(file_type=path.suffix[1:])
    if path.suffix == ".gltf":  # its buffers in the file itself
        content = json.loads(data["model.gltf"])
        for buffer in content["buffers"]:
            buffer["uri"] = "data:application/octet-stream;base64," + b64encode(data[buffer["uri"]]).decode()
        data = json.dumps(content).encode()
    path.write_bytes(data)
    return path


def small() -> trimesh.Trimesh:
    return trimesh.creation.icosphere(subdivisions=1)


@pytest.mark.parametrize(
    ("suffix", "binary"),
    [("vtk", True), ("vtk", False), ("vtp", True), ("vtu", True), ("vtu", False)],  # VTK fails to write vtp as text
)
def test_vtk_files(tmp_path: Path, suffix: str, binary: bool) -> None:
    ball = small()
    read = read_points(save_vtk(tmp_path / f"a.{suffix}", ball, binary))
    assert read.points == pytest.approx(ball.vertices, abs=1e-7)
    assert read.confidence is not None
    assert read.confidence.tolist() == list(range(len(ball.vertices)))
    assert read.colours is not None
    assert read.colours.reshape(-1).tolist() == [k % 256 for k in range(3 * len(ball.vertices))]
    assert "its vertices are used" in read.notes[0]


def test_a_volume_mesh_gives_its_outside(tmp_path: Path) -> None:
    import pyvista

    grid = pyvista.ImageData(dimensions=(4, 4, 4)).cast_to_unstructured_grid()
    grid.save(tmp_path / "a.vtu")
    read = read_points(tmp_path / "a.vtu")
    assert len(read.points) == 64 - 8
    assert "solid cells" in read.notes[0]


@pytest.mark.parametrize("suffix", ["glb", "gltf"])
def test_nodes_of_a_scene_are_applied(tmp_path: Path, suffix: str) -> None:
    ball = small()
    scan = ScanFile(path=save_scene(tmp_path / f"a.{suffix}", ball)).run("m")
    expected = np.concatenate([trimesh.transform_points(ball.vertices, T) for T in (PLACES[0], PLACES[0] @ PLACES[1])])
    order = [np.lexsort(points.round(4).T) for points in (scan.points, expected)]
    assert scan.points[order[0]] == pytest.approx(expected[order[1]], abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "suffix", ["ply", "glb", *(pytest.param(suffix, marks=pytest.mark.slow) for suffix in ("stl", "obj", "vtp", "vtk"))]
)
def test_a_mesh_with_holes_and_edges_of_three_triangles_is_a_scan(tmp_path: Path, suffix: str) -> None:
    trimesh.creation.box(damaged_box.SIZE).export(tmp_path / "box.stl")
    path, unit = tmp_path / f"a.{suffix}", "m" if suffix == "glb" else "mm"
    assert not sheets().is_watertight
    if suffix in VTK:
        save_vtk(path, sheets())
    else:
        moved = sheets().copy()
        moved.apply_scale(1e-3 if suffix == "glb" else 1.0)
        moved.export(path)
    job = {"version": 1, "tolerance": 0.4, "align": "none", "report": "none", "units": "mm"}
    done = damageest.run(job | {"part": str(tmp_path / "box.stl"), "scan": {"path": str(path), "unit": unit}})
    assert done.damage_volume == pytest.approx(np.pi / 2 * RADIUS**2 * DEPTH, rel=0.03)


def test_gltf_that_is_not_read_says_why(tmp_path: Path) -> None:
    path = save_scene(tmp_path / "a.glb", small())
    data = path.read_bytes()
    length = struct.unpack_from("<I", data, 12)[0]
    content = json.loads(data[20 : 20 + length])

    def write(changed: dict[str, Any]) -> None:
        text = json.dumps(changed).encode()
        text += b" " * (-len(text) % 4)
        head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(data) - 20 - length)
        path.write_bytes(head + struct.pack("<I4s", len(text), b"JSON") + text + data[20 + length :])

    for change, says in (
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "export without compression"),
        ({"buffers": [{"uri": "other.bin", "byteLength": 9}]}, "in another file, 'other.bin'; export GLB"),
        ({"accessors": [{"count": 10**12, "componentType": 5126, "type": "VEC3"}]}, "too small for its vertices"),
        ({"meshes": [], "nodes": []}, "cannot be read|no points"),
    ):
        write(content | change)
        with pytest.raises(InputError, match=rf"a\.glb: .*({says})"):
            read_points(path)
    write(content)
    assert len(read_points(path).points) == 2 * len(small().vertices)


@cache
def sound(suffix: str) -> bytes:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"a.{suffix}"
        return (save_vtk(path, small(), suffix == "vtp") if suffix in VTK else save_scene(path, small())).read_bytes()


@pytest.mark.parametrize("suffix", [*VTK, "glb", "gltf"])
@given(data=st.data())
@settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_damaged_file_is_refused_by_name_or_read(suffix: str, data: Any, tmp_path: Path) -> None:
    changed = bytearray(sound(suffix))
    if data.draw(st.booleans()):
        changed = changed[: data.draw(st.integers(1, len(changed)))]
    for _ in range(data.draw(st.integers(0, 4))):
        changed[data.draw(st.integers(0, len(changed) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(changed)
    try:
        assert read_points(path).points.shape[1] == 3
    except InputError as error:
        assert path.name in str(error)  # noqa: PT017
