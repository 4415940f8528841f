"""Files read in pieces give the points that they give as a whole, and a thinned scan finds the same damage."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import damageest
from damageest.errors import InputError, JobError
from damageest.io.meshes import write_points
from damageest.io.points import read_points, streams
from damageest.stages.scan.file import ScanFile
from tests import damaged_box
from tests.stages.scan.test_file import write_e57, write_las

POINTS = 16_000


def write_npy(path: Path, points: np.ndarray) -> None:
    np.save(path, points)


def write_ply(path: Path, points: np.ndarray) -> None:
    x, y, z = points.T
    write_points(path, {"x": x, "y": y, "z": z})


WRITERS = {"npy": write_npy, "ply": write_ply, "las": write_las, "laz": write_las, "e57": write_e57}


@pytest.fixture
def cloud() -> np.ndarray:
    return np.random.default_rng(0).normal(size=(3000, 3)).round(3)


@pytest.mark.parametrize("suffix", WRITERS)
def test_pieces_are_the_whole(suffix: str, cloud: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "PIECE", 700)
    path = tmp_path / f"scan.{suffix}"
    WRITERS[suffix](path, cloud)
    whole, stream = read_points(path), streams.open_stream(path)
    assert stream is not None
    assert stream.count == len(cloud)
    pieces = list(stream.read())
    assert len(pieces) > 1
    assert (np.concatenate([piece.points for piece in pieces]) == whole.points).all()
    assert {piece.unit for piece in pieces} == {whole.unit}


def test_positions_of_an_e57_file_are_kept(cloud: np.ndarray, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(streams, "PIECE", 700)
    write_e57(tmp_path / "two.e57", cloud, cloud + 1, translation=(1.0, 2, 3))
    whole = ScanFile(path=tmp_path / "two.e57", most_points=0).run("mm")
    thinned = ScanFile(path=tmp_path / "two.e57", most_points=2000).run("mm")
    assert thinned.total == 2 * len(cloud)
    assert 1800 < len(thinned.points) < 2200
    where = {tuple(point): tuple(whole.viewpoints[view]) for point, view in zip(whole.points, whole.view, strict=True)}
    for point, view in zip(thinned.points, thinned.view, strict=True):
        assert where[tuple(point)] == tuple(thinned.viewpoints[view])


@pytest.mark.parametrize("suffix", ["npy", "ply", "las", "e57"])
def test_a_truncated_file_is_refused(suffix: str, cloud: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / f"scan.{suffix}"
    WRITERS[suffix](path, cloud)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match=rf"scan\.{suffix}"):
        ScanFile(path=path, most_points=1000).run("mm")


@pytest.mark.parametrize("suffix", ["npy", "ply"])
def test_a_thinned_scan_keeps_its_normals(suffix: str, cloud: np.ndarray, tmp_path: Path) -> None:
    path = tmp_path / f"scan.{suffix}"
    normals = cloud / np.linalg.norm(cloud, axis=1, keepdims=True)
    if suffix == "npy":
        np.save(path, np.column_stack([cloud, normals]))
    else:
        columns = ("x", "y", "z", "nx", "ny", "nz")
        write_points(path, dict(zip(columns, (*cloud.T, *normals.T), strict=True)))
    whole, few = (ScanFile(path=path, most_points=most).run("mm") for most in (0, 1000))
    assert few.total == len(cloud)
    assert whole.normals is not None
    assert few.normals is not None
    of = {tuple(point): normal for point, normal in zip(whole.points, whole.normals, strict=True)}
    np.testing.assert_allclose(few.normals, [of[tuple(point)] for point in few.points], atol=1e-12)


def write_job(folder: Path, most_points: int, **more: object) -> Path:
    damaged_box.write(folder)
    points = damaged_box.scan(POINTS).astype(np.float32)
    np.save(folder / "scan.npy", points)
    scan = {"use": "file", "path": "scan.npy", "most_points": most_points, **more}
    job = {"version": 1, "tolerance": 0.4, "align": "none", "part": "box.stl", "scan": scan, "report": "none"}
    (folder / "job.yaml").write_text(json.dumps(job))
    return folder / "job.yaml"


@pytest.mark.slow
def test_a_thinned_scan_has_all_points_of_the_damage(tmp_path: Path) -> None:
    whole = damageest.run(write_job(tmp_path / "whole", 0))
    few = damageest.run(write_job(tmp_path / "few", POINTS // 4), output=tmp_path / "out")
    again = damageest.run(tmp_path / "few/job.yaml", output=tmp_path / "out")
    assert (few.scan.total, whole.scan.total) == (POINTS, 0)
    assert len(few.scan.points) < 0.6 * POINTS
    assert [len(site.points) for site in few.sites] == [len(site.points) for site in whole.sites]
    assert [site.verdict.level for site in few.sites] == ["proven"]
    assert few.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.01)
    assert (few.scan.points == again.scan.points).all()
    assert any(f"the files have {POINTS} points" in note for note in few.scan.notes)
    assert json.loads((tmp_path / "out/result.json").read_text())["scan"]["total"] == POINTS


@pytest.mark.slow
def test_crops_hold_for_the_points_added(tmp_path: Path) -> None:
    low = [-30, -30, -30]
    few = damageest.run(
        write_job(tmp_path, POINTS // 4, crop=[{"keep": "box", "min": low, "max": [0, 30, 30]}]), settings=[]
    )
    assert few.scan.points[:, 0].max() <= 0


@pytest.mark.slow
def test_a_file_is_read_whole_for_a_crop_that_needs_all_points(tmp_path: Path) -> None:
    count = ScanFile.model_fields["most_points"].default + 1000
    np.save(tmp_path / "scan.npy", np.random.default_rng(0).random((count, 3), dtype=np.float32))
    assert ScanFile(path=tmp_path / "scan.npy").run("mm").total == count
    assert not ScanFile(path=tmp_path / "scan.npy", crop=[{"keep": "largest piece"}]).run("mm").total


def test_a_crop_that_needs_all_points_is_refused(tmp_path: Path) -> None:
    with pytest.raises((InputError, JobError), match="most_points: 0"):
        damageest.run(write_job(tmp_path, POINTS // 4, crop=[{"keep": "largest piece"}]))
