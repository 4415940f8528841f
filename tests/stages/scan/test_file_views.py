"""Where the scanner stood: from the job, and from formats that say so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from damageest.artefacts import Floats
from damageest.errors import InputError
from damageest.io.points import read_points
from damageest.io.scans import make_scan
from damageest.stages.scan.file import ScanFile

HERE = (1.0, 2.0, 3.0)


@pytest.fixture
def cloud() -> Floats:
    return np.random.default_rng(0).normal(size=(50, 3))


def write_text(path: Path, points: Floats) -> Path:
    np.savetxt(path, points, fmt="%.17g")
    return path


def write_pcd(path: Path, points: Floats, viewpoint: str = "0 0 0 1 0 0 0", width: int = 0) -> Path:
    shape = f"WIDTH {width or len(points)}\nHEIGHT {len(points) // width if width else 1}\n"
    head = f"VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n{shape}VIEWPOINT {viewpoint}\n"
    path.write_bytes(f"{head}POINTS {len(points)}\nDATA binary\n".encode() + points.astype("<f8").tobytes())
    return path


def range_image(columns: int = 60, rows: int = 40) -> Floats:
    """A camera at the origin: a plane 500 away with a block of 100 in front of it; a tenth of the pixels is empty."""
    row, column = np.divmod(np.arange(columns * rows), columns)
    depth = np.where((np.abs(column - 30) < 10) & (np.abs(row - 20) < 8), 400.0, 500.0)
    points = depth[:, None] * np.column_stack([0.01 * (column - 29.5), 0.01 * (row - 19.5), np.ones(len(row))])
    points[::10] = np.nan
    return points


def test_the_job_says_where_the_scanner_stood(tmp_path: Path, cloud: Floats) -> None:
    path = write_text(tmp_path / "a.xyz", cloud)
    assert ScanFile(path=path).run(unit="mm").viewpoints is None
    scan = ScanFile(path=path, viewpoint=HERE, unit="m").run(unit="mm")
    assert scan.viewpoints == pytest.approx(1000 * np.array([HERE]))
    assert scan.view is not None
    assert (scan.view == 0).all()


def test_views_with_and_without_a_position_mix(tmp_path: Path, cloud: Floats) -> None:
    """Copies and gaps are left out, and each point keeps its view."""
    broken = cloud.copy()
    broken[3] = np.nan
    a, b, c = (
        write_text(tmp_path / f"{k}.xyz", points)
        for k, points in zip("abc", (broken, cloud + 9, cloud + 18), strict=True)
    )
    again = write_text(tmp_path / "d.xyz", np.concatenate([cloud[:5], cloud[:5] + 30]))
    files: Any = [{"path": a, "viewpoint": HERE}, b, {"path": c}, {"path": again, "viewpoint": (0, 0, 9)}]
    scan = ScanFile(path=files).run(unit="mm")
    assert scan.viewpoints is not None
    assert scan.view is not None
    assert scan.viewpoints.tolist() == [list(HERE), [0, 0, 9]]
    assert scan.view.tolist() == [0] * 49 + [-1] * 100 + [1] * 6  # the point lost in a.xyz comes from d.xyz
    assert scan.paths == tuple(map(str, (a, b, c, again)))


def test_a_position_in_the_job_replaces_that_of_the_file(tmp_path: Path, cloud: Floats) -> None:
    path = write_pcd(tmp_path / "a.pcd", cloud, "7 8 9 1 0 0 0")
    assert ScanFile(path=path).run(unit="mm").viewpoints == pytest.approx(np.array([[7, 8, 9]]))
    assert ScanFile(path=path, viewpoint=HERE).run(unit="mm").viewpoints == pytest.approx(np.array([HERE]))


@pytest.mark.parametrize(
    ("line", "position"),
    [
        ("0 0 0 1 0 0 0", None),
        ("0.0 0 -0 1.0 0 0 0", None),
        ("0 0 0 0.5 0.5 0.5 0.5", [0, 0, 0]),
        ("1 2 3 1 0 0 0", [1, 2, 3]),
        ("1 2 3", None),
        ("a b c d e f g", None),
    ],
)
def test_the_viewpoint_of_a_pcd_file(tmp_path: Path, cloud: Floats, line: str, position: list[float] | None) -> None:
    found = read_points(write_pcd(tmp_path / "a.pcd", cloud, line)).viewpoints
    assert (None if found is None else found[0].tolist()) == position


def test_an_organised_pcd_file_of_a_camera_has_its_origin_as_position(tmp_path: Path) -> None:
    image = range_image()
    scan = ScanFile(path=write_pcd(tmp_path / "a.pcd", image, width=60)).run(unit="mm")
    assert scan.viewpoints == pytest.approx(np.zeros((1, 3)))
    assert scan.view is not None
    assert len(scan.view) == 2160
    # also with a VIEWPOINT: the origin of the rays is what counts
    moved = read_points(write_pcd(tmp_path / "b.pcd", image, "5 5 5 1 0 0 0", 60))
    assert moved.viewpoints == pytest.approx(np.zeros((1, 3)))


@pytest.mark.parametrize("moved", [True, False])
def test_an_organised_pcd_file_in_another_frame_has_no_position(tmp_path: Path, moved: bool) -> None:
    """A camera's image that was moved, and a height map."""
    image = range_image()
    if moved:
        image = image + np.array([40.0, 0, 150])
    else:
        image[:, :2] = np.column_stack([np.arange(len(image)) % 60, np.arange(len(image)) // 60]) * 5.0
    assert read_points(write_pcd(tmp_path / "a.pcd", image, width=60)).viewpoints is None


def write_e57(path: Path, *scans: tuple[Floats, dict[str, Any]], grid: bool = False) -> Path:
    import pye57

    with pye57.E57(str(path), mode="w") as file:
        for points, pose in scans:
            data = {f"cartesian{axis}": np.ascontiguousarray(points[:, k]) for k, axis in enumerate("XYZ")}
            if grid:
                data |= {"rowIndex": np.arange(len(points)) // 10, "columnIndex": np.arange(len(points)) % 10}
            file.write_scan_raw(data, **pose)
    return path


def test_the_poses_of_an_e57_file(tmp_path: Path, cloud: Floats) -> None:
    moved = {"rotation": np.array([0.5, 0.5, 0.5, 0.5]), "translation": np.array(HERE)}
    one = read_points(write_e57(tmp_path / "one.e57", (cloud, moved)))
    assert one.viewpoints == pytest.approx(np.array([HERE]))
    two = ScanFile(path=write_e57(tmp_path / "two.e57", (cloud, {}), (cloud, moved))).run(unit="mm")
    assert two.viewpoints == pytest.approx(1000 * np.array([(0, 0, 0), HERE]))
    assert two.view is not None
    assert two.view.tolist() == [0] * 50 + [1] * 50


def test_an_e57_file_that_does_not_say_where_its_scanner_stood(tmp_path: Path, cloud: Floats) -> None:
    assert read_points(write_e57(tmp_path / "a.e57", (cloud, {}))).viewpoints is None
    assert read_points(write_e57(tmp_path / "b.e57", (cloud, {}), (cloud + 1, {}))).viewpoints is None
    structured = read_points(write_e57(tmp_path / "c.e57", (cloud, {}), grid=True))
    assert structured.viewpoints == pytest.approx(np.zeros((1, 3)))


def ptx(
    points: Floats, columns: int, shift: tuple[float, ...] = HERE, position: tuple[float, ...] | None = None
) -> str:
    """A scan turned by 90 degrees about z and then moved."""
    place = " ".join(map(str, position or shift))
    head = (
        f"{columns}\n{len(points) // columns}\n{place}\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n{place} 1\n"
    )
    head = head if position is None else head.replace(f"{place} 1\n", " ".join(map(str, shift)) + " 1\n")
    return head + "".join("{:.9g} {:.9g} {:.9g} 0.5\n".format(*row) for row in points)


def test_ptx_files(tmp_path: Path, cloud: Floats) -> None:
    first, second = cloud.copy(), cloud + 100
    first[7] = 0
    path = tmp_path / "a.ptx"
    path.write_text(ptx(first, 10) + ptx(second, 5, (0, 0, 50)))
    scan = ScanFile(path=path).run(unit="m")
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    expected = np.concatenate([np.delete(first, 7, 0) @ turn.T + HERE, second @ turn.T + (0, 0, 50)])
    assert scan.points == pytest.approx(expected, abs=1e-6)
    assert scan.viewpoints == pytest.approx(np.array([HERE, (0, 0, 50)]))
    assert scan.view is not None
    assert scan.view.tolist() == [0] * 49 + [1] * 50
    assert ScanFile(path=path).run(unit="mm").points == pytest.approx(1000 * expected, abs=1e-3)


def test_a_ptx_file_whose_position_contradicts_its_transform(tmp_path: Path, cloud: Floats) -> None:
    (tmp_path / "a.ptx").write_text(ptx(cloud, 10, position=(5, 5, 5)))
    read = read_points(tmp_path / "a.ptx")
    assert read.viewpoints is None
    assert "its scanner position differs from its transform" in read.notes[0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: text[: len(text) // 2], "truncated|same number of columns"),
        (lambda text: text.replace("0 1 0 0\n", "0 2 0 0\n"), "not rigid"),
        (lambda text: "x\n" + text, "not that of a PTX file"),
        (lambda _: "\n\n", "no scans"),
        (lambda text: text.replace(" 0.5\n", "\n", 1), "same number of columns"),
        (lambda text: text.replace("0.5", "half", 1), "'half' is not a number"),
    ],
)
def test_faults_of_a_ptx_file(tmp_path: Path, cloud: Floats, change: Any, says: str) -> None:
    (tmp_path / "a.ptx").write_text(change(ptx(cloud, 10)))
    with pytest.raises(InputError, match=says):
        read_points(tmp_path / "a.ptx")


def test_views_of_an_array(cloud: Floats) -> None:
    scan = make_scan(cloud, viewpoints=np.array([HERE]))
    assert scan.view is not None
    assert (scan.view == 0).all()
    for options in (
        {"viewpoints": np.eye(3)},
        {"viewpoints": np.array([HERE]), "view": np.ones(50, int)},
        {"viewpoints": np.array([1.0, 2, 3])},
        {"view": np.zeros(50, int)},
    ):
        with pytest.raises(InputError, match="view"):
            make_scan(cloud, **options)
