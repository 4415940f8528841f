"""A small sound file of each format that damageest reads, as bytes: what the fuzzing spoils."""

from __future__ import annotations

import io
import struct
import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tests import damaged_box

POINTS = 600
JOB = """version: 1
name: fuzz
units: mm
tolerance: 0.5
part: {use: file, path: box.stl}
scan:
  use: file
  path: [points.npy]
  crop: [{keep: box, min: [-99, -99, -99], max: [99, 99, 99]}]
align: {use: none, T_part_scan: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
cluster: &near {use: dbscan, neighbours: 10}
method: auto
sites: {drop: [], keep: {min: [-99, -99, -99], max: [99, 99, 99]}}
output: out/fuzz
"""


@cache
def points() -> np.ndarray[Any, Any]:
    """(N,3) points on the damaged box."""
    every = damaged_box.scan()
    return every[:: len(every) // POINTS][:POINTS].round(4)


@cache
def mesh() -> trimesh.Trimesh:
    return trimesh.creation.box(damaged_box.SIZE)


def _ply(form: str) -> bytes:
    head = f"ply\nformat {form} 1.0\nelement vertex {POINTS}\n" + "".join(f"property float {a}\n" for a in "xyz")
    order = ">" if "big" in form else "<"
    body = "".join("{} {} {}\n".format(*p) for p in points()).encode() if form == "ascii" else b""
    return head.encode() + b"end_header\n" + (body or points().astype(order + "f4").tobytes())


def _pcd(form: str) -> bytes:
    head = "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    head += f"WIDTH {POINTS}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {POINTS}\nDATA {form}\n"
    if form == "ascii":
        return (head + "".join("{} {} {}\n".format(*p) for p in points())).encode()
    if form == "binary":
        return head.encode() + points().astype("<f4").tobytes()
    block = points().astype("<f4").T.tobytes()
    packed = b"".join(bytes([len(block[i : i + 32]) - 1]) + block[i : i + 32] for i in range(0, len(block), 32))
    return head.encode() + struct.pack("<II", len(packed), len(block)) + packed


def _ptx() -> bytes:
    head = f"{POINTS // 20}\n20\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
    return (head + "".join("{:.7f} {:.7f} {:.7f} 0.5\n".format(*p) for p in points() / 1000)).encode()


def _las(suffix: str) -> bytes:
    import laspy

    head = laspy.LasHeader(point_format=0, version="1.2")
    head.scales = [1e-4] * 3
    file = laspy.LasData(head)
    file.x, file.y, file.z = points().T
    with tempfile.TemporaryDirectory() as folder:
        file.write(str(Path(folder, f"a{suffix}")))
        return Path(folder, f"a{suffix}").read_bytes()


def _e57() -> bytes:
    import pye57

    with tempfile.TemporaryDirectory() as folder:
        file = pye57.E57(str(Path(folder, "a.e57")), mode="w")
        file.write_scan_raw({f"cartesian{a}": points()[:, k] / 1000 for k, a in enumerate("XYZ")})
        file.close()
        return Path(folder, "a.e57").read_bytes()


def _npy() -> bytes:
    stream = io.BytesIO()
    np.save(stream, points())
    return stream.getvalue()


def _three_mf() -> bytes:
    body = trimesh.Scene(mesh()).export(file_type="3mf")
    assert isinstance(body, bytes)
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(body)) as old, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(zipfile.ZipInfo(name), old.read(name), zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def _cad(suffix: str) -> bytes:
    import cadquery

    part = cadquery.Workplane().box(*damaged_box.SIZE).edges("|Z").fillet(3).faces(">Z").workplane().hole(5).val()
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder, f"a{suffix}"))
        if suffix == ".brep":
            part.exportBrep(path)
        elif suffix == ".iges":
            from OCP.IGESControl import IGESControl_Writer

            writer = IGESControl_Writer("MM", 1)
            writer.AddShape(part.wrapped)
            writer.Write(path)
        else:
            part.exportStep(path)
        return Path(path).read_bytes()


def _mesh(kind: str) -> bytes:
    data = mesh().export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)


SCANS = {
    "ascii.ply": lambda: _ply("ascii"),
    "little.ply": lambda: _ply("binary_little_endian"),
    "big.ply": lambda: _ply("binary_big_endian"),
    "ascii.pcd": lambda: _pcd("ascii"),
    "binary.pcd": lambda: _pcd("binary"),
    "packed.pcd": lambda: _pcd("binary_compressed"),
    "plain.xyz": lambda: "".join("{} {} {}\n".format(*p) for p in points()).encode(),
    "table.csv": lambda: b"x,y,z\n" + "".join("{},{},{}\n".format(*p) for p in points()).encode(),
    "array.npy": _npy,
    "grid.ptx": _ptx,
    "scan.e57": _e57,
    "scan.las": lambda: _las(".las"),
    "scan.laz": lambda: _las(".laz"),
    "scan.obj": lambda: "".join("v {} {} {}\n".format(*p) for p in points()).encode(),
    "scan.off": lambda: f"OFF\n{POINTS} 0 0\n".encode() + "".join("{} {} {}\n".format(*p) for p in points()).encode(),
}
PARTS = {
    "part.stl": lambda: _mesh("stl"),
    "text.stl": lambda: _mesh("stl_ascii"),
    "part.ply": lambda: _mesh("ply"),
    "part.obj": lambda: _mesh("obj"),
    "part.off": lambda: _mesh("off"),
    "part.3mf": _three_mf,
    "part.step": lambda: _cad(".step"),
    "part.iges": lambda: _cad(".iges"),
    "part.brep": lambda: _cad(".brep"),
}
JOBS = {"job.yaml": lambda: JOB.encode()}
NATIVE = ("part.step", "part.iges", "part.brep")
"""Read by OpenCASCADE, with the plugin cadquery."""


@cache
def seed(name: str) -> bytes:
    """The sound file of a name in SCANS, PARTS or JOBS."""
    return (SCANS | PARTS | JOBS)[name]()


def write_others(folder: Path) -> None:
    """Writes the sound part and scan that a spoiled file is read together with."""
    folder.mkdir(parents=True, exist_ok=True)
    mesh().export(folder / "box.stl")
    np.save(folder / "points.npy", points())


def make_job(name: str) -> str:
    """The job that reads a file of this name: as scan, as part, or as the job itself."""
    part, scan = (name, "points.npy") if name in PARTS else ("box.stl", name)
    return f"version: 1\ntolerance: 0.5\npart: {part}\nscan: {scan}\nalign: none\n"
