"""A folder as a scan: its files are patches in one frame; what is not read, and what is broken, is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import damageest
from damageest.errors import InputError, JobError
from damageest.io.meshes import write_points
from damageest.result import Result
from damageest.stages.scan.file import ScanFile
from tests import damaged_box
from tests.stages.scan.test_file_views import write_e57

JOB = {"version": 1, "tolerance": 0.4, "align": "none", "report": "none", "part": "box.stl", "scan": "patches"}


def write_patches(folder: Path) -> np.ndarray:
    """The damaged box in four patches of four formats; gives its points."""
    points = damaged_box.scan(6000).astype(np.float32).astype(np.float64)
    folder.mkdir(parents=True)
    trimesh.creation.box(damaged_box.SIZE).export(folder.parent / "box.stl")
    a, b, c, d = np.array_split(points, 4)
    write_points(folder / "1.ply", dict(zip("xyz", a.T, strict=True)))
    np.savetxt(folder / "2.xyz", b, fmt="%.17g")
    np.save(folder / "3.npy", c)
    trimesh.PointCloud(d / 1000).export(folder / "4.glb")  # metres
    return points


@pytest.fixture(scope="module")
def read_twice(tmp_path_factory: pytest.TempPathFactory) -> tuple[np.ndarray, Result, Result]:
    """The points of a folder, its result, and that of the folder without one of its patches."""
    tmp_path = tmp_path_factory.mktemp("folder")
    points = write_patches(tmp_path / "patches")
    (tmp_path / "patches/.hidden.ply").write_bytes(b"no scan")
    (tmp_path / "patches/inner").mkdir()
    (tmp_path / "patches/inner/5.xyz").write_text("0 0 500\n")
    (tmp_path / "patches/project.raw").write_bytes(b"of a scanner")
    job = JOB | {"part": str(tmp_path / "box.stl"), "scan": str(tmp_path / "patches")}
    first = damageest.run(job, output=tmp_path / "out")
    (tmp_path / "patches/2.xyz").unlink()
    return points, first, damageest.run(job, output=tmp_path / "out")


@pytest.mark.slow
def test_the_patches_of_a_folder_are_one_scan(read_twice: tuple[np.ndarray, Result, Result]) -> None:
    points, done, _ = read_twice
    assert done.scan.points == pytest.approx(points, abs=1e-5)
    assert [Path(path).name for path in done.scan.paths] == ["1.ply", "2.xyz", "3.npy", "4.glb"]
    assert done.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)
    (warning,) = (one for one in done.warnings if one.code == "files_not_read")
    assert warning.amount == 1
    assert "project.raw" in warning.text


@pytest.mark.slow
def test_a_folder_is_read_again_when_a_patch_changes(read_twice: tuple[np.ndarray, Result, Result]) -> None:
    _, first, again = read_twice
    assert len(first.scan.points) - len(again.scan.points) == 1500


def test_each_patch_keeps_its_scanner_position(tmp_path: Path) -> None:
    cloud = np.random.default_rng(0).normal(size=(50, 3))
    turned = {"rotation": np.array([0.5, 0.5, 0.5, 0.5]), "translation": np.array([1.0, 2, 3])}
    write_e57(tmp_path / "a.e57", (cloud, turned))
    write_e57(tmp_path / "b.e57", (cloud, turned | {"translation": np.array([4.0, 5, 6])}))
    np.savetxt(tmp_path / "c.xyz", cloud)
    scan = ScanFile(path=tmp_path, unit="m").run("mm")
    assert scan.viewpoints == pytest.approx(1000 * np.array([[1.0, 2, 3], [4, 5, 6]]))
    assert scan.view is not None
    assert scan.view.tolist() == [0] * 50 + [1] * 50 + [-1] * 50


def test_a_broken_patch_is_named(tmp_path: Path) -> None:
    write_patches(tmp_path / "patches")
    path = tmp_path / "patches/1.ply"
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(InputError, match=r"1\.ply: .*truncated"):
        ScanFile(path=tmp_path / "patches").run("mm")


def test_folders_that_are_no_scan(tmp_path: Path) -> None:
    (tmp_path / "patches").mkdir()
    job = JOB | {"part": str(tmp_path / "box.stl"), "scan": str(tmp_path / "patches")}
    trimesh.creation.box(damaged_box.SIZE).export(tmp_path / "box.stl")
    with pytest.raises(JobError, match="without a file that can be read as a scan"):
        damageest.run(job)
    with pytest.raises(JobError, match="misspelt: there is no such file"):
        damageest.run(job | {"scan": str(tmp_path / "misspelt")})
    np.savetxt(tmp_path / "patches/a.xyz", np.eye(3))
    trimesh.creation.box(damaged_box.SIZE).export(tmp_path / "patches/box.stl")
    with pytest.raises(JobError, match="is the part, and among the files of the scan"):
        damageest.run(job | {"part": str(tmp_path / "patches/box.stl")})
    with pytest.raises(InputError, match="is the one that this run writes to"):
        damageest.run(job, output=tmp_path / "patches")
    with pytest.raises(InputError, match="viewpoint is of one view"):
        ScanFile(path=tmp_path / "patches", viewpoint=(0, 0, 1)).run("mm")
