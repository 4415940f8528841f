"""A small sound file of each format that damageest reads, as bytes: what the fuzzing spoils."""

from __future__ import annotations

import io
import re
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
accept: all
output: out/fuzz
"""


@cache
def points() -> np.ndarray[Any, Any]:
    """(N,3) points on the damaged box."""
    every = damaged_box.scan()
    return every[:: len(every) // POINTS][:POINTS].round(4)


@cache
def dense() -> np.ndarray[Any, Any]:
    """As `points`, enough of them to find the pose."""
    return damaged_box.scan(6000).round(4)


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


def _gltf(kind: str) -> bytes:
    """A scene that is one file: .glb, or .gltf with its data in it."""
    import base64
    import json

    scene = trimesh.Scene(trimesh.PointCloud(points() / 1000))
    if kind == "glb":
        return bytes(scene.export(file_type="glb"))
    files = scene.export(file_type="gltf")
    content = json.loads(files["model.gltf"])
    for buffer in content["buffers"]:
        data = base64.b64encode(files[buffer["uri"]]).decode()
        buffer["uri"] = f"data:application/octet-stream;base64,{data}"
    return json.dumps(content).encode()


def _vtk(suffix: str, text: bool) -> bytes:
    import pyvista

    cloud = pyvista.PolyData(points())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"a{suffix}")
        (cloud.cast_to_unstructured_grid() if suffix == ".vtu" else cloud).save(path, binary=not text)
        return path.read_bytes()


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
    "scan.pts": lambda: f"{POINTS}\n".encode() + "".join("{} {} {} 100\n".format(*p) for p in points()).encode(),
    "scan.txt": lambda: b"//X;Y;Z\n" + "".join("{};{};{}\n".format(*p) for p in points()).encode(),
    "scan.asc": lambda: b"# mm\n" + "".join("{:.4f} {:.4f} {:.4f}\n".format(*p) for p in points()).encode(),
    "scan.glb": lambda: _gltf("glb"),
    "scan.gltf": lambda: _gltf("gltf"),
    "text.vtk": lambda: _vtk(".vtk", True),
    "scan.vtk": lambda: _vtk(".vtk", False),
    "scan.vtp": lambda: _vtk(".vtp", False),
    "text.vtu": lambda: _vtk(".vtu", True),
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
SECTIONS = """sections:
  - {along: axis, count: 3}
  - {z: 5, name: top}
  - {plane: {point: [0, 0, 4], normal: [0, 0.2, 1]}, kind: contour}
  - {line: {from: [-19, 0, 10], to: [19, 0, 10]}}
temperature: {part: 26, uncertainty: 1, expansion: 11.5e-6}
"""
DATUMS = """align:
  use: register
  datum: {A: [{facing: {direction: [0, 0, -1], angle: 5}}], B: [{at: [-20, 0, 0]}], C: [{at: [0, -15, 0]}]}
allowance: {use: milling, outer: 0.5}
"""
PATH = """path:
  use: layers
  height: 2
  width: 4
  feed: 480
  nozzle: {tip_radius: 3, cone_angle: 25, length: 90, body_radius: 15}
  process: [{set: {power: 1800}}, {layer: 1, set: {power: 2200}}]
export: {use: files, format: [stl, 3mf], paths: [csv, apt, krl], machine: kuka}
"""
JOBS = {
    "job.yaml": lambda: JOB.encode(),
    "sections.yaml": lambda: (JOB + SECTIONS).encode(),
    "datums.yaml": lambda: re.sub("align: .*\n", "", JOB + DATUMS, count=1).replace("points.npy", "dense.npy").encode(),
    "path.yaml": lambda: (JOB + PATH).encode(),
}
NATIVE = (".step", ".iges", ".brep")
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
    np.save(folder / "dense.npy", dense())


def make_job(name: str) -> str:
    """The job that reads a file of this name: as scan, as part, or as the job itself."""
    part, scan = (name, "points.npy") if name in PARTS else ("box.stl", name)
    return f"version: 1\ntolerance: 0.5\npart: {part}\nscan: {scan}\nalign: none\naccept: all\n"
