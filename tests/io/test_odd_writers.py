"""Files in odd but valid ways are read right, or refused with the right reason: 200 ways of each format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from damageest.errors import InputError
from damageest.io.meshes import read_mesh
from damageest.io.points import read_points
from damageest.io.triangles import MESH_SUFFIXES
from tests.io.writers import clouds, meshes, text, vtk
from tests.io.writers.base import Written
from tests.needs import import_or_skip

WRITERS = {
    **{"text": text.write_text, "pts": text.write_pts, "ptx": text.write_ptx, "ply": clouds.write_ply},
    **{"pcd": clouds.write_pcd, "npy": clouds.write_npy, "las": clouds.write_las, "stl": meshes.write_stl},
    **{"obj": meshes.write_obj, "off": meshes.write_off, "3mf": meshes.write_3mf, "gltf": meshes.write_gltf},
    **{"vtk": vtk.write_vtk, "vtp": vtk.write_vtp, "e57": vtk.write_e57},
}
NEEDED = {"vtk": "pyvista", "vtp": "pyvista", "e57": "pye57"}
FEW, MANY = 6, 200


def judge(written: Written, folder: Path) -> str:
    """What is wrong with how a file is read; empty where nothing is."""
    for name, data in written.files.items():
        (folder / (f"scan{name}" if name.startswith(".") else name)).write_bytes(data)
    path = folder / f"scan{next(iter(written.files))}"
    try:
        found = read_points(path)
    except InputError as error:
        return "" if written.refused and written.refused in str(error) else f"refused: {error}"
    if written.refused:
        return f"not refused: {written.refused}"
    points = found.points[np.isfinite(found.points).all(axis=1)]
    if written.ordered and points.shape != written.points.shape:
        return f"{len(points)} points for {len(written.points)}"
    if written.ordered:
        off = np.abs(points - written.points).max()
    else:
        off = max(cKDTree(a).query(b)[0].max() for a, b in ((points, written.points), (written.points, points)))
    if off > written.error:
        return f"points are {off:.3g} off"
    if written.normals is not None and (found.normals is None or np.abs(found.normals - written.normals).max() > 1e-4):
        return "normals are not read"
    if written.area and path.suffix.lower() in MESH_SUFFIXES:
        try:
            vertices, faces, _ = read_mesh(path)
        except InputError as error:
            return f"refused as a mesh: {error}"
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
        return "" if abs(area - written.area) < 1e-3 else f"the area is {area:.6g} for {written.area}"
    return ""


def need(name: str) -> None:
    if name in NEEDED:
        import_or_skip(NEEDED[name])


def run(name: str, count: int, folder: Path) -> list[str]:
    wrong = []
    for seed in range(count):
        place = folder / str(seed)
        place.mkdir()
        written = WRITERS[name](np.random.default_rng(seed))
        if told := judge(written, place):
            wrong.append(f"{seed}: {told}: {written.ways}")
    return wrong


@pytest.mark.parametrize("name", WRITERS)
def test_a_few_ways_of_each_format(name: str, tmp_path: Path) -> None:
    need(name)
    assert not run(name, FEW, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
def test_many_ways_of_each_format(name: str, tmp_path: Path) -> None:
    need(name)
    assert not run(name, MANY, tmp_path)
