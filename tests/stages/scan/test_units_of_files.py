"""The unit of a file: its header or the standard of its format gives it unless the job does, and this is said."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import damageest
from damageest.io.points.attributes import find_unit
from damageest.stages.scan.file import ScanFile
from tests import damaged_box

CLOUD = np.random.default_rng(0).normal(size=(50, 3)).round(6)
ROWS = "".join("{!r} {!r} {!r}\n".format(*map(float, p)) for p in CLOUD)
VTK = "# vtk DataFile Version 3.0\nunit: in\nASCII\nDATASET POLYDATA\nPOINTS 50 double\n"
PLY = "ply\nformat ascii 1.0\ncomment %s\nelement vertex 50\n" + "".join(f"property double {a}\n" for a in "xyz")


def write_vtp(path: Path) -> None:
    import pyvista

    cloud = pyvista.PolyData(CLOUD)
    cloud.field_data["Length_Unit"] = ["inch"]
    cloud.save(path)


def write_3mf(path: Path) -> None:
    """A box of 1 x 2 x 3 inches."""
    box = trimesh.creation.box((1.0, 2, 3))
    corners = "".join('<vertex x="{}" y="{}" z="{}"/>'.format(*p) for p in box.vertices)
    faces = "".join('<triangle v1="{}" v2="{}" v3="{}"/>'.format(*f) for f in box.faces)
    model = (
        '<?xml version="1.0" encoding="UTF-8"?><model unit="inch" xml:lang="en-US" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model">'
        f"<mesh><vertices>{corners}</vertices><triangles>{faces}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("3D/3dmodel.model", model)


INCHES: dict[str, Any] = {
    "a.ply": lambda path: path.write_text(PLY % "units: inches" + "end_header\n" + ROWS),
    "a.obj": lambda path: path.write_text("# File units = inches\n" + "v " + ROWS.strip().replace("\n", "\nv ") + "\n"),
    "a.txt": lambda path: path.write_text("X [in]\tY [in]\tZ [in]\n" + ROWS),
    "a.xyz": lambda path: path.write_text("# all units are in inches\n" + ROWS),
    "a.off": lambda path: path.write_text("OFF\n# unit inch\n50 0 0\n" + ROWS),
    "a.vtp": write_vtp,
    "a.vtk": lambda path: path.write_text(VTK + ROWS),
}  # fmt: skip

NAMES = [pytest.param(name, marks=pytest.mark.needs("pyvista")) if ".vt" in name else name for name in INCHES]


@pytest.mark.parametrize("name", NAMES)
def test_the_header_gives_the_unit_and_this_is_said(tmp_path: Path, name: str) -> None:
    INCHES[name](tmp_path / name)
    scan = ScanFile(path=tmp_path / name).run("mm")
    assert scan.points == pytest.approx(25.4 * CLOUD, abs=1e-4)
    (told,) = scan.warnings
    assert told.code == "unit"
    assert name in told.text
    assert "inches" in told.text
    assert "scan.unit: mm" in told.remedy
    same = ScanFile(path=tmp_path / name).run("in")
    assert not same.warnings
    assert any("the lengths are inches" in note for note in same.notes)


@pytest.mark.parametrize("name", NAMES)
def test_the_unit_of_the_job_is_used_and_a_contradiction_is_said(tmp_path: Path, name: str) -> None:
    INCHES[name](tmp_path / name)
    scan = ScanFile(path=tmp_path / name, unit="mm").run("mm")
    assert scan.points == pytest.approx(CLOUD, abs=1e-6)
    (told,) = scan.warnings
    assert "scan.unit: mm" in told.text
    assert "although its header says" in told.text
    assert not ScanFile(path=tmp_path / name, unit="in").run("mm").warnings


def test_3mf_has_a_unit(tmp_path: Path) -> None:
    write_3mf(tmp_path / "a.3mf")
    scan = ScanFile(path=tmp_path / "a.3mf").run("mm")
    assert np.ptp(scan.points, axis=0) == pytest.approx([25.4, 50.8, 76.2], abs=1e-4)
    assert "inches" in scan.warnings[0].text


def test_gltf_has_metres_by_its_standard(tmp_path: Path) -> None:
    trimesh.PointCloud(CLOUD).export(tmp_path / "a.glb")
    scan = ScanFile(path=tmp_path / "a.glb").run("mm")
    assert scan.points == pytest.approx(1000 * CLOUD, abs=1e-3)
    assert scan.notes == ("a.glb: converted from m to mm",)
    other = ScanFile(path=tmp_path / "a.glb", unit="mm").run("mm")
    assert other.points == pytest.approx(CLOUD, abs=1e-6)
    assert "although .glb files have metres" in other.warnings[0].text


@pytest.mark.parametrize(
    ("line", "unit"),
    [
        ("units: mm", "mm"),
        ("Unit = Millimeters", "mm"),
        ("UNITS ARE IN METRES", "m"),
        ("unit of length: 'cm'", "cm"),
        ("units: in", "in"),
        ("units in mm", "mm"),
        ("unit normals of the points", None),
        ("made by a program for the unit of Mr. Meter", None),
        ("units: mm; unit: inch", None),
        ("community: m", None),
        ("unit mmm", None),
    ],
)
def test_lines_that_name_a_unit(line: str, unit: str | None) -> None:
    assert find_unit([line])[0] == unit


@pytest.mark.slow
def test_a_run_tells_of_the_unit_that_it_took(tmp_path: Path) -> None:
    """The box in inches, its job in millimetres: the volume is right, and the unit is among the warnings."""
    damaged_box.write_small(tmp_path)
    points = damaged_box.scan(6000) / 25.4
    np.savetxt(tmp_path / "scan.txt", points, header="units: inch", fmt="%.9g")
    job = {"version": 1, "tolerance": 0.4, "align": "none", "report": "none"}
    job |= {"part": str(tmp_path / "box.stl"), "scan": str(tmp_path / "scan.txt")}
    done = damageest.run(job, output=tmp_path / "out")
    assert done.damage_volume == pytest.approx(damaged_box.TRUE_VOLUME, rel=0.05)
    content = json.loads((tmp_path / "out/result.json").read_text())
    assert [one["code"] for one in content["warnings"] if "inch" in one["text"]] == ["unit"]
