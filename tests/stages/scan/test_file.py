"""The readers of scans: what goes in comes out, and what is no scan is refused by name."""

from __future__ import annotations

import io
import struct
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from damageest.errors import InputError
from damageest.io.points import READERS, read_points
from damageest.io.points.pcd import _unpack_lzf
from damageest.stages.scan.file import ScanFile

coordinates = st.floats(-1e6, 1e6, allow_nan=False).map(lambda x: x + 0.0)
clouds = st.integers(1, 40).flatmap(lambda n: arrays(np.float64, (n, 3), elements=coordinates))
quick = settings(
    max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def ply(points, kind="f8", order="<", form="binary_little_endian", faces=False, extra=True):
    head = f"ply\nformat {form} 1.0\ncomment made here\nelement vertex {len(points)}\n"
    name = {"f8": "double", "f4": "float"}[kind]
    head += "".join(f"property {name} {a}\n" for a in "xyz") + ("property uchar red\n" if extra else "")
    head += "element face 1\nproperty list uchar int vertex_indices\n" if faces else ""
    head += "end_header\n"
    if form == "ascii":
        rows = "".join("{!r} {!r} {!r}{}\n".format(*map(float, p), " 7" if extra else "") for p in points)
        return head.encode() + rows.encode() + (b"3 0 0 0\n" if faces else b"")
    table = np.zeros(len(points), [(a, order + kind) for a in "xyz"] + ([("red", "u1")] if extra else []))
    for k, axis in enumerate("xyz"):
        table[axis] = points[:, k]
    return head.encode() + table.tobytes() + (struct.pack(order + "B3i", 3, 0, 0, 0) if faces else b"")


def pcd(points, form):
    n = len(points)
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z _ intensity\nSIZE 8 8 8 1 4\nTYPE F F F U F\nCOUNT 1 1 1 3 1\n"
    head += f"WIDTH {n}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {n}\nDATA {form}\n"
    if form == "ascii":
        return (head + "".join("{!r} {!r} {!r} 1 2 3 0.5\n".format(*map(float, p)) for p in points)).encode()
    table = np.zeros(n, [("x", "<f8"), ("y", "<f8"), ("z", "<f8"), ("_", "u1", 3), ("i", "<f4")])
    for k, axis in enumerate("xyz"):
        table[axis] = points[:, k]
    if form == "binary":
        return head.encode() + table.tobytes()
    block = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in table.dtype.names)
    packed = b"".join(bytes([len(block[i : i + 32]) - 1]) + block[i : i + 32] for i in range(0, len(block), 32))
    return head.encode() + struct.pack("<II", len(packed), len(block)) + packed


def text(points, separator=" ", head="", tail=""):
    return (head + "".join(separator.join(repr(float(x)) for x in p) + tail + "\n" for p in points)).encode()


def npy(points):
    stream = io.BytesIO()
    np.save(stream, points)
    return stream.getvalue()


def stl(points):
    corners = np.repeat(points, 3, axis=0).astype("<f4").reshape(-1, 9)
    return (
        bytes(80) + struct.pack("<I", len(corners)) + b"".join(bytes(12) + row.tobytes() + bytes(2) for row in corners)
    )


WRITERS = {
    "little.ply": lambda p: ply(p),
    "faces.ply": lambda p: ply(p, faces=True),
    "big.ply": lambda p: ply(p, order=">", form="binary_big_endian"),
    "ascii.ply": lambda p: ply(p, form="ascii", faces=True),
    "ascii.pcd": lambda p: pcd(p, "ascii"),
    "binary.pcd": lambda p: pcd(p, "binary"),
    "packed.pcd": lambda p: pcd(p, "binary_compressed"),
    "plain.xyz": lambda p: text(p),
    "tabs.txt": lambda p: text(p, "\t", "# x y z\n// another\n"),
    "count.pts": lambda p: text(p, " ", f"{len(p)}\n", " -1200 10 20 30"),
    "commas.csv": lambda p: text(p, ",", "X,Y,Z\n"),
    "semicolons.csv": lambda p: text(p, ";", '"x [mm]";"y [mm]";"z [mm]"\n').replace(b".", b","),
    "windows.asc": lambda p: text(p).replace(b"\n", b"\r\n"),
    "array.npy": npy,
    "mesh.obj": lambda p: b"# o\n" + b"".join(b"v " + row + b"\n" for row in text(p).splitlines()) + b"f 1 1 1\n",
    "mesh.off": lambda p: f"OFF\n{len(p)} 0 0\n".encode() + text(p),
}


@pytest.mark.parametrize("name", sorted(WRITERS))
@given(points=clouds)
@quick
def test_every_point_comes_back_to_the_last_digit(name, points, tmp_path):
    path = tmp_path / name
    path.write_bytes(WRITERS[name](points))
    np.testing.assert_array_equal(read_points(path).points, points)


@pytest.mark.parametrize("name", ["plain.xyz", "tabs.txt", "commas.csv", "little.ply", "mesh.stl"])
@given(points=clouds)
@quick
def test_single_precision_formats_keep_single_precision(name, points, tmp_path):
    single = points.astype(np.float32).astype(np.float64)
    path = tmp_path / name
    if name == "mesh.stl":
        path.write_bytes(stl(single))
        expected = np.unique(single + 0.0, axis=0)
        np.testing.assert_array_equal(np.unique(read_points(path).points + 0.0, axis=0), expected)
    else:
        path.write_bytes(ply(single, "f4") if name == "little.ply" else WRITERS[name](single))
        np.testing.assert_array_equal(read_points(path).points, single)


PACKAGES = {".e57": "pye57", ".vtk": "pyvista", ".vtp": "pyvista", ".vtu": "pyvista"}
SUFFIXES = [
    pytest.param(name, marks=pytest.mark.needs(PACKAGES[name])) if name in PACKAGES else name
    for name in sorted(READERS)
]


@pytest.mark.parametrize("suffix", SUFFIXES)
@given(garbage=st.binary(max_size=300))
@quick
def test_garbage_is_refused_by_name_or_read_as_numbers(suffix, garbage, tmp_path):
    path = tmp_path / f"garbage{suffix}"
    path.write_bytes(garbage)
    try:
        cloud = read_points(path)
    except InputError as error:
        assert path.name in str(error)  # noqa: PT017
    else:
        assert cloud.points.shape[1] == 3


@pytest.mark.variants(19)
@pytest.mark.parametrize("name", [*sorted(WRITERS), "scan.las", "scan.laz", "scan.e57"])
@given(data=st.data())
@quick
def test_a_damaged_file_is_refused_or_read_but_never_a_crash(name, data, tmp_path):
    points = np.random.default_rng(1).normal(size=(50, 3))
    path = tmp_path / name
    if name in WRITERS:
        path.write_bytes(WRITERS[name](points))
    else:
        {"las": write_las, "laz": write_las, "e57": write_e57}[name[-3:]](path, points)
    whole = bytearray(path.read_bytes())
    cut = data.draw(st.integers(1, len(whole)))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] = data.draw(st.integers(0, 255))
    path.write_bytes(bytes(whole[:cut]))
    try:
        assert len(read_points(path).points)
    except InputError as error:
        assert path.name in str(error)  # noqa: PT017


def write_las(path: Path, points, offset=0.0):
    import laspy

    header = laspy.LasHeader(point_format=3, version="1.2")
    header.offsets = np.full(3, offset)
    header.scales = np.full(3, 1e-6)
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.T
    las.write(str(path))


def write_e57(path: Path, *views, rotation=(1.0, 0, 0, 0), translation=(0.0, 0, 0)):
    import pye57

    with pye57.E57(str(path), mode="w") as file:
        for k, points in enumerate(views):
            moved = k == len(views) - 1 and len(views) > 1
            file.write_scan_raw(
                {f"cartesian{axis}": np.ascontiguousarray(points[:, i]) for i, axis in enumerate("XYZ")},
                rotation=np.array(rotation) if moved else np.array([1.0, 0, 0, 0]),
                translation=np.array(translation) if moved else np.zeros(3),
            )


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_georeferenced_coordinates_keep_their_digits(suffix, tmp_path):
    points = np.random.default_rng(0).uniform(0, 1, (500, 3)).round(6) + 5_400_000.0
    write_las(tmp_path / f"far{suffix}", points, offset=5_400_000.0)
    scan = ScanFile(path=tmp_path / f"far{suffix}").run(unit="m")
    np.testing.assert_allclose(scan.points, points, rtol=0, atol=1e-8)


def test_e57_is_in_metres_and_each_scan_has_its_pose(tmp_path):
    a, b = np.random.default_rng(0).normal(size=(2, 100, 3))
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    half = np.sqrt(0.5)
    write_e57(tmp_path / "two.e57", a, b, rotation=(half, 0, 0, half), translation=(1.0, 2, 3))
    scan = ScanFile(path=tmp_path / "two.e57").run(unit="mm")
    np.testing.assert_allclose(
        scan.points, 1000 * np.concatenate([a, b @ turn.T + [1, 2, 3]]), atol=1e-3
    )  # stored float32
    assert any("from m to mm" in note for note in scan.notes)
    same = ScanFile(path=tmp_path / "two.e57", unit="mm").run(unit="mm")
    np.testing.assert_allclose(same.points * 1000, scan.points, atol=1e-6)


def test_views_are_joined_copies_and_gaps_left_out(tmp_path):
    points = np.random.default_rng(0).normal(size=(40, 3))
    broken = points.copy()
    broken[3] = np.nan
    (tmp_path / "a.xyz").write_bytes(text(broken))
    (tmp_path / "b.ply").write_bytes(ply(np.concatenate([points[:5], points[:5] + 9])))
    scan = ScanFile(path=(tmp_path / "a.xyz", tmp_path / "b.ply")).run(unit="mm")
    expected = np.concatenate([np.delete(points, 3, 0), points[3:4], points[:5] + 9])
    np.testing.assert_array_equal(scan.points, expected)
    assert scan.paths == (str(tmp_path / "a.xyz"), str(tmp_path / "b.ply"))
    assert "removed 1 points with coordinates that are not finite" in scan.notes
    assert "removed 4 duplicate points" in scan.notes


def test_unit_of_the_files_is_converted_into_the_jobs(tmp_path):
    points = np.random.default_rng(0).normal(size=(40, 3))
    (tmp_path / "a.xyz").write_bytes(text(points))
    scan = ScanFile(path=tmp_path / "a.xyz", unit="inches").run(unit="mm")
    np.testing.assert_allclose(scan.points, points * 25.4)
    assert scan.unit == "mm"


def test_normals_are_found_in_six_columns_and_by_header_but_colours_are_not(tmp_path):
    rng = np.random.default_rng(0)
    points, normals = rng.normal(size=(2, 60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    path = tmp_path / "n.xyz"
    path.write_bytes(text(np.hstack([points, normals])))
    np.testing.assert_allclose(ScanFile(path=path).run(unit="mm").normals, normals)
    path.write_bytes(text(np.hstack([points, rng.integers(0, 256, (60, 3))])))
    assert ScanFile(path=path).run(unit="mm").normals is None
    path.write_bytes(text(np.hstack([3 * normals, points]), head="nx ny nz x y z\n"))
    scan = ScanFile(path=path).run(unit="mm")
    np.testing.assert_allclose(scan.points, points)
    np.testing.assert_allclose(scan.normals, normals)
    path.write_bytes(text(np.hstack([normals, points])))
    np.testing.assert_allclose(ScanFile(path=path, columns="_ _ _ x y z").run(unit="mm").points, points)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("empty.ply", b"", "empty"),
        ("page.xyz", b"<!DOCTYPE html><html></html>", "web page"),
        ("scan.docx", b"PK", "the format '.docx' cannot be read"),
        ("short.ply", ply(np.ones((9, 3)))[:-1], "8 of 9 vertices"),
        ("short.pcd", pcd(np.ones((9, 3)), "binary")[:-1], "8 of 9 points"),
        ("none.ply", ply(np.empty((0, 3))), "no points"),
        ("two.xyz", b"1 2\n3 4\n", "2 columns"),
        ("ragged.xyz", b"1 2 3\n4 5\n", "row 2 has 2 columns"),
        ("words.xyz", b"1 2 3\n4 five 6\n", "'five' is not a number"),
        ("nan.xyz", b"nan nan nan\n", "no points"),
    ],
)
def test_what_is_no_scan_is_refused_with_the_reason(name, content, says, tmp_path):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says) as error:
        ScanFile(path=tmp_path / name).run(unit="mm")
    assert name in str(error.value)


def test_missing_file_and_folder_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.ply: there is no such file"):
        ScanFile(path=tmp_path / "nowhere.ply").run(unit="mm")
    with pytest.raises(InputError, match="is a folder"):
        ScanFile(path=tmp_path).run(unit="mm")


def test_lzf_references_may_overlap_what_they_write():
    # 'a', then 9 more by a reference one byte back: control 7<<5, length byte 0, distance 0
    assert _unpack_lzf(bytes([0, ord("a"), 7 << 5, 0, 0]), 10) == b"a" * 10
    with pytest.raises(ValueError, match="corrupt"):
        _unpack_lzf(bytes([7 << 5, 0, 9]), 10)


@pytest.mark.slow
def test_a_million_points_read_fast(tmp_path):
    points = np.random.default_rng(0).normal(size=(1_000_000, 3))
    path = tmp_path / "million.ply"
    path.write_bytes(ply(points, "f4", extra=False))
    start = time.process_time()
    scan = ScanFile(path=path).run(unit="mm")
    assert time.process_time() - start < 3.0  # 0.2 s on an idle machine; a row-by-row reader takes far longer
    assert len(scan.points) == 1_000_000
