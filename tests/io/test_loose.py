"""Vertices of a mesh scan that none of its faces uses are no points of the scan."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from damageest.io.meshes import read_mesh
from damageest.io.points import PointFile, read_points


def save(path: Path, loose: int, text: bool = False) -> Path:
    """A ball of 162 vertices, and ``loose`` others before and after them."""
    ball = trimesh.creation.icosphere(2)
    others = np.random.default_rng(0).uniform(5, 9, (loose, 3))
    vertices = np.concatenate([others[: loose // 2], ball.vertices, others[loose // 2 :]])
    mesh = trimesh.Trimesh(vertices, ball.faces + loose // 2, process=False)
    mesh.export(path, **({"encoding": "ascii"} if text else {}))
    return path


@pytest.mark.parametrize(("name", "text"), [("a.ply", False), ("a.ply", True), ("a.obj", False), ("a.off", False)])
def test_loose_vertices_are_left_out_and_told(tmp_path: Path, name: str, text: bool) -> None:
    path = save(tmp_path / name, 40, text)
    file = read_points(path)
    assert len(file.points) == 162
    assert np.linalg.norm(file.points, axis=1).max() < 1.001
    assert "40 of 202 vertices belong to no face of the mesh" in " ".join(file.notes)
    assert len(read_mesh(path)[1]) == 320, "as a part, its faces still refer to their vertices"


def count(file: PointFile) -> tuple[int, bool]:
    return len(file.points), "belong to no face" in " ".join(file.notes)


@pytest.mark.parametrize("loose", [0, 1000])
def test_a_file_of_points_with_some_faces_keeps_its_points(tmp_path: Path, loose: int) -> None:
    assert count(read_points(save(tmp_path / "a.ply", loose))) == (162 + loose, False)


def test_faces_that_are_cut_off_take_no_points(tmp_path: Path) -> None:
    path = save(tmp_path / "a.ply", 40)
    path.write_bytes(path.read_bytes()[:-500])
    assert count(read_points(path)) == (202, False)
