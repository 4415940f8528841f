"""Files as public reports of other tools describe them, made anew and small: each has its address and what it holds."""

from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from damageest.errors import InputError
from damageest.io.parts import read_part
from damageest.io.scans import read_scan
from tests.io.writers.base import box, split

CORNERS, QUADS = box()
TRIANGLES = [part for face in QUADS for part in split(face)]
FAR = np.array([4.5e6, 5.5e5, 0.0])
POINTS = np.random.default_rng(8).uniform(0, 50, (60, 3)).round(3)


@dataclass(frozen=True)
class Report:
    """``address`` of the report after https://github.com/; ``name`` and ``data`` of the file. ``volume``: of a part, in
    mm³; ``points``: of a scan; ``refused``, ``said``: what an error, or a note or warning, has to say."""

    address: str
    name: str
    data: bytes
    volume: float = 0.0
    points: np.ndarray | None = None
    refused: str = ""
    said: str = ""


def lines(rows: np.ndarray, by: str = " ") -> str:
    return "".join(by.join(f"{v:.10g}" for v in row) + "\n" for row in rows)


def ply(
    faces: bytes | str, form: str = "ascii", listed: str = "list uchar int vertex_indices", count: int = 12
) -> bytes:
    head = f"ply\nformat {form} 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n"
    head += f"element face {count}\nproperty {listed}\nend_header\n"
    if isinstance(faces, str):
        return (head + lines(CORNERS) + faces).encode()
    return head.encode() + CORNERS.astype("<f4").tobytes() + faces


def pcd(
    fields: str, size: str, kind: str, count: str, data: str, body: bytes, number: int = 60, more: str = ""
) -> bytes:
    head = f"VERSION 0.7\nFIELDS {fields}\nSIZE {size}\nTYPE {kind}\nCOUNT {count}\n{more or 'WIDTH 60'}\n"
    head += "" if "HEIGHT" in more else "HEIGHT 1\n"
    head += "" if "VIEWPOINT" in more else "VIEWPOINT 0 0 0 1 0 0 0\n"
    return f"{head}POINTS {number}\nDATA {data}\n".encode() + body


def stl(header: bytes) -> bytes:
    data = header.ljust(80, b"\0") + struct.pack("<I", 12)
    for face in TRIANGLES:
        data += bytes(12) + CORNERS[face].astype("<f4").tobytes() + b"\0\0"
    return data


def text_stl(name: str, empty: bool = False) -> bytes:
    text = f"solid {name}\n"
    for face in [] if empty else TRIANGLES:
        corners = "".join("   vertex {:.8f} {:.8f} {:.8f}\n".format(*CORNERS[c]) for c in face)
        text += f" facet normal 0 0 0\n  outer loop\n{corners}  endloop\n endfacet\n"
    return f"{text}endsolid {name}\n".encode()


def three_mf(unit: str, shift: float) -> bytes:
    import io

    vertices = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in CORNERS)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in TRIANGLES)
    mesh = f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh>"
    items = "".join(f'<item objectid="1" transform="1 0 0 0 1 0 0 0 1 {x} 0 0"/>' for x in (0, shift))
    model = (
        f'<?xml version="1.0"?><model unit="{unit}" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
        f'<resources><object id="1" type="model">{mesh}</object></resources><build>{items}</build></model>'
    )
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)
    return stream.getvalue()


def obj_in_blocks() -> bytes:
    """Each body after the other, its faces by numbers that count backward."""
    text = ""
    for shift in (0, 10):
        text += "".join(f"v {x + shift} {y} {z}\n" for x, y, z in CORNERS)
        text += "".join("f " + " ".join(str(c - 8) for c in face) + "\n" for face in TRIANGLES)
    return text.encode()


def compress(data: bytes) -> bytes:
    """LZF: a literal byte, and references back to it where it repeats."""
    out, at = b"", 0
    while at < len(data):
        run = 1
        while at + run < len(data) and data[at + run] == data[at] and run < 250:
            run += 1
        out += bytes([0, data[at]])
        at += 1
        if run >= 11:
            out += bytes([7 << 5, run - 1 - 9, 0])
            at += run - 1
    return struct.pack("<II", len(out), len(data)) + out


FACES = "".join(f"3 {a} {b} {c}\n" for a, b, c in TRIANGLES)
BINARY = b"".join(struct.pack("<B3i", 3, *face) for face in TRIANGLES)
XYZ = POINTS.astype("<f4")
WITH_NAN = XYZ.copy()
WITH_NAN[::7] = np.nan
STRIPES = (POINTS + FAR).astype("<f4")
HEAD = "ply\nformat binary_little_endian 1.0\nelement vertex 60\n"
HEAD += "property float x\nproperty float y\nproperty float z\nend_header\n"
STRIPS = "47 " + " ".join(f"{a} {b} {c} -1" for a, b, c in TRIANGLES)[:-3] + "\n"
BOX = 60.0

REPORTS = [
    Report("mikedh/trimesh/pull/2556", "part.obj", obj_in_blocks(), volume=2 * BOX),
    Report("CesiumGS/obj2gltf/issues/184", "part.obj", "".join(
        [*(f"v {x} {y} {z}\n" for x, y, z in CORNERS), *("f " + " ".join(str(c - 8) for c in f) + "\n" for f in QUADS)]
    ).encode(), volume=BOX, said="6 of 6 faces"),
    Report("tinyobjloader/tinyobjloader/issues/140", "part.obj", "".join(
        [*(f"v {x} {y} {z}\n" for x, y, z in CORNERS), *(f"f {a}/0/0 {b}/1/0 {c}/2/0\n" for a, b, c in TRIANGLES)]
    ).encode(), refused="OBJ counts from 1"),
    Report("cnr-isti-vclab/meshlab/issues/290", "part.ply", ply(
        "".join(f"3 {a} {b} {c} 6 0 0 1 0 1 1\n" for a, b, c in TRIANGLES),
        listed="list ushort uint vertex_indices\nproperty list uchar float texcoord"), volume=BOX),
    Report("assimp/assimp/issues/2337", "part.ply", ply("").replace(b"element face 12", b"element tristrips 1").replace(
        b"list uchar", b"list int") + STRIPS.encode(),
        volume=BOX),
    Report("cnr-isti-vclab/meshlab/issues/437", "part.ply", ply(FACES, count=13), volume=BOX),
    Report("cnr-isti-vclab/meshlab/issues/437", "scan.ply", ply(FACES, count=13), points=CORNERS),
    Report("mariolukas/FabScanPi-Server/issues/133", "scan.ply", ply("\n", count=0), points=CORNERS),
    Report("mikedh/trimesh/issues/1911", "part.ply", ply(BINARY + b"\0\0\0", "binary_little_endian"), volume=BOX),
    Report("mikedh/trimesh/issues/37", "part.ply", ply(FACES, listed="list uchar int vertex_index"), volume=BOX),
    Report("mikedh/trimesh/pull/416", "scan.ply", HEAD.encode() + XYZ.tobytes(), points=XYZ),
    Report("unitycoder/UnityPointCloudViewer/issues/34", "scan.ply", HEAD.replace(
        "1.0\n", "1.0\nobj_info Generated by CloudCompare!\n").encode() + XYZ.tobytes(), points=XYZ),
    Report("GaryHuan9/Echo/issues/48", "part.ply", ply("".join("4 {} {} {} {}\n".format(*f) for f in QUADS), count=6),
           volume=BOX),
    Report("stla/cgalMeshes/issues/6", "part.ply", ply(FACES + FACES[: FACES.index("\n") + 1], count=13), volume=BOX),
    Report("nschloe/meshio/issues/530", "part.stl", stl(b"solid base"), volume=BOX),
    Report("humu2009/jsc3d/issues/2", "part.stl", stl(b"solid plate facet normal 0 0 0 endsolid"), volume=BOX),
    Report("mikedh/trimesh/issues/95", "part.stl", text_stl("Empty", empty=True), refused="STL"),
    Report("cnr-isti-vclab/meshlab/issues/734", "part.stl", text_stl("2STL_V_1_0" + "/" * 400 + "BYE"), volume=BOX),
    Report("PointCloudLibrary/pcl/issues/2261", "scan.pcd", pcd(
        "x y z i", "4 4 4 4", "F F F F", "1 1 1 1", "binary_compressed",
        compress(b"".join(XYZ[:, k].tobytes() for k in range(3)) + bytes(240))), points=XYZ),
    Report("ros-perception/perception_pcl/issues/226", "scan.pcd", pcd(
        "x y z _ rgb _", "4 4 4 1 4 1", "F F F U F U", "1 1 1 4 1 12", "binary",
        b"".join(p.tobytes() + bytes(20) for p in XYZ)), points=XYZ),
    Report("isl-org/Open3D/issues/1016", "scan.pcd", pcd(
        "x y z", "4 4 4", "F F F", "1 1 1", "binary", WITH_NAN.tobytes(), more="WIDTH 10\nHEIGHT 6"),
        points=XYZ[np.arange(60) % 7 != 0], said="removed 9 points"),
    Report("isl-org/Open3D/issues/6924", "scan.pcd", pcd(
        "x y z timestamp flags", "4 4 4 8 1", "f f f f u", "1 1 1 1 1", "ascii",
        lines(np.column_stack([POINTS, np.full(60, 2530.875404584), np.ones(60)])).encode()), points=POINTS),
    Report("DanielPollithy/pypcd/issues/6", "scan.pcd", pcd(
        "x y z i t reflectivity ring ambient range", "4 4 4 4 4 2 1 2 4", "F F F F U U U U U", "1 1 1 1 1 1 1 1 1",
        "binary", b"".join(p.tobytes() + struct.pack("<fIHBHI", 1, 2, 3, 4, 5, 6) for p in XYZ)), points=XYZ),
    Report("naurril/SUSTechPOINTS/issues/77", "scan.pcd", pcd(
        "x y z", "8 8 8", "F F F", "1 1 1", "binary", POINTS.tobytes()), points=POINTS),
    Report("CloudCompare/CloudCompare/pull/1435", "scan.pcd", pcd(
        "x y z", "4 4 4", "I I I", "1 1 1", "binary", POINTS.round().astype("<i4").tobytes()), points=POINTS.round()),
    Report("CloudCompare/CloudCompare/issues/1999", "scan.pcd", pcd(
        "x y z", "4 4 4", "F F F", "1 1 1", "binary", XYZ.tobytes(),
        more="WIDTH 60\nHEIGHT 1\nVIEWPOINT 1 2 3 0.7071068 0.7071068 0 0"), points=XYZ, said="not applied"),
    Report("gaoxiang12/slam_in_autonomous_driving/issues/75", "scan.pcd", pcd(
        "x y z", "4 4 4", "F F F", "1 1 1", "binary", XYZ.tobytes(), more="WIDTH 0\nHEIGHT 0"), points=XYZ),
    Report("CloudCompare/CloudCompare/issues/380", "scan.csv", (
        "name,x,y,z\n" + "".join(f"P{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(POINTS))).encode(),
        refused="'P0' is not a number"),
    Report("CloudCompare/CloudCompare/issues/2178", "scan.xyz", lines(
        np.hstack([POINTS, np.ones((60, 597))])).encode(), points=POINTS, said="columns 1, 2, 3 of 600"),
    Report("CloudCompare/CloudCompare/issues/639", "scan.csv", (
        "X,Y,Z,Intensity\n" + lines(np.hstack([POINTS, POINTS[:, :1]]), ",")).encode(), points=POINTS),
    Report("VUKOZ-OEL/3d-forest-classic/issues/17", "scan.pcd", pcd(
        "x y z intensity", "8 8 8 8", "F F F F", "1 1 1 1", "binary",
        np.column_stack([POINTS, POINTS[:, 0]]).tobytes()), points=POINTS),
    Report("cdcseacave/openMVS/issues/244", "scan.ply", HEAD.encode() + STRIPES.tobytes(), points=STRIPES,
           said="single precision"),
    Report("OpenDroneMap/ODM/issues/522", "scan.ply", HEAD.replace("float", "double").encode() + (
        POINTS + FAR).tobytes(), points=(POINTS + FAR)),
    Report("potree/PotreeConverter/issues/105", "scan.xyz", lines(
        POINTS + FAR).encode(), points=(POINTS + FAR)),
    Report("prusa3d/PrusaSlicer/issues/15545", "part.3mf", three_mf("inch", 20), volume=2 * BOX * 25.4**3,
           said="from in to mm"),
    Report("prusa3d/PrusaSlicer/issues/15842", "part.3mf", three_mf("centimeter", 20), volume=2 * BOX * 1000),
    Report("prusa3d/PrusaSlicer/issues/15699", "part.3mf", three_mf("meter", 20), volume=2 * BOX * 1e9),
    Report("prusa3d/PrusaSlicer/issues/15031", "part.3mf", three_mf("micron", 2000), volume=2 * BOX * 1e-9),
]  # fmt: skip


def check(report: Report, path: Path) -> None:
    path.write_bytes(report.data)
    read: Callable[[], tuple[str, ...]] = lambda: check_scan(report, path)  # noqa: E731
    if report.name.startswith("part"):
        read = lambda: check_part(report, path)  # noqa: E731
    if report.refused:
        with pytest.raises(InputError, match=report.refused):
            read()
        return
    assert report.said in " ".join(read())


def check_part(report: Report, path: Path) -> tuple[str, ...]:
    part = read_part(path, "mm")
    assert part.volume == pytest.approx(report.volume, rel=1e-6)
    return part.notes


def check_scan(report: Report, path: Path) -> tuple[str, ...]:
    scan = read_scan([path], "mm")
    if report.points is not None:
        assert scan.points.shape == report.points.shape
        np.testing.assert_allclose(scan.points, report.points, atol=1e-5, rtol=1e-9)
    return (*scan.notes, *scan.columns, *map(str, scan.warnings))


@pytest.mark.parametrize("report", REPORTS, ids=lambda report: f"{report.address} {report.name}")
def test_a_report(report: Report, tmp_path: Path) -> None:
    check(report, tmp_path / report.name)
