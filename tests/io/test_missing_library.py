"""A missing library is reported as such, not as a fault of the file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from damageest.io.meshes import read_mesh
from damageest.io.points import read_points


def test_a_points_reader_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "scan.las"
    path.write_bytes(b"LASF")
    monkeypatch.setitem(sys.modules, "laspy", None)
    with pytest.raises(ImportError, match="laspy"):
        read_points(path)


def test_a_mesh_reader_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    def fail(*arguments: object, **options: object) -> None:
        raise ImportError("No module named 'lxml'")

    path = tmp_path / "part.3mf"
    path.write_bytes(b"PK")
    monkeypatch.setattr(trimesh, "load_scene", fail)
    with pytest.raises(ImportError, match="lxml"):
        read_mesh(path)
