"""The list of CAD faces says of each what the triangles that carry its number say."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from damageest_cadquery.brep import Brep
from typer.testing import CliRunner

from damageest.cli import app
from damageest.errors import InputError, JobError
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


@pytest.fixture(scope="module")
def step(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A block with a bore, rounded edges, a dimple, a ring and a cone; one of its faces has a name."""
    block = cq.Workplane().box(40, 30, 20).edges("|Z").fillet(4).faces(">Z").workplane().hole(8)
    block = block.cut(cq.Workplane().sphere(3).translate((-13, 6, 10)))
    block = block.union(cq.Workplane(cq.Solid.makeCone(5, 2, 6, cq.Vector(13, 0, 10))))
    ring = cq.Workplane("XZ").circle(3).revolve(360, (-12, 0), (-12, 1)).translate((60, 0, 0))
    path = tmp_path_factory.mktemp("faces") / "a.step"
    cq.exporters.export(cq.Workplane(cq.Compound.makeCompound([*block.vals(), *ring.vals()])), str(path))
    text = path.read_text()
    path.write_text(text.replace("ADVANCED_FACE(''", "ADVANCED_FACE('seat <A>'", 1))
    return path


@pytest.mark.slow
@pytest.mark.parametrize("unit", [pytest.param("mm", marks=pytest.mark.slow), "in"])
def test_each_face_is_that_of_its_triangles(step: Path, unit: str) -> None:
    stage = Brep(path=step, chord=0.004 / (25.4 if unit == "in" else 1), angle=8)
    part, faces = stage.run(unit=unit, tolerance=None), stage.cad_faces(unit)
    assert part.faces_brep is not None
    assert [face.number for face in faces] == list(range(len(part.face_kinds)))
    assert tuple(face.kind for face in faces) == part.face_kinds
    assert tuple(face.name for face in faces) == part.face_names
    for face in faces:
        own = part.faces_brep == face.number
        corners, cross = part.triangles[own], part.cross[own]
        size = np.linalg.norm(cross, axis=1) / 2
        assert face.area == pytest.approx(size.sum(), rel=2e-3)
        centre = (corners.mean(1) * size[:, None]).sum(0) / size.sum()
        np.testing.assert_allclose(face.centre, centre, atol=2e-3 * part.diagonal)
        at, normals = corners.mean(1), cross / (2 * size[:, None])
        if face.kind == "plane":
            np.testing.assert_allclose(normals, np.broadcast_to(face.normal, normals.shape), atol=1e-6)  # type: ignore[arg-type]
        if face.kind in ("cylinder", "sphere"):
            off = at - np.array(face.point)
            if face.kind == "cylinder":
                off = off - np.outer(off @ np.array(face.axis), np.array(face.axis))
            np.testing.assert_allclose(np.linalg.norm(off, axis=1), face.radius, rtol=5e-3)  # type: ignore[arg-type]
            assert (np.einsum("ij,ij->i", off, normals) < 0).all() == face.hollow
        if face.kind == "torus":
            off = at - np.array(face.point)
            along = off @ np.array(face.axis)
            outward = np.hypot(np.linalg.norm(off - np.outer(along, np.array(face.axis)), axis=1) - face.radius, along)
            np.testing.assert_allclose(outward * (25.4 if unit == "in" else 1), 3, rtol=5e-3)
    assert {"plane", "cylinder", "sphere", "torus", "cone"} == {face.kind for face in faces}
    assert {face.hollow for face in faces if face.kind == "cylinder"} == {True, False}
    assert "seat <A>" in part.face_names


@pytest.mark.parametrize("suffix", [".step", ".iges", ".brep"])
def test_every_cad_format(suffix: str, tmp_path: Path) -> None:
    from OCP.IGESControl import IGESControl_Writer

    shape, path = cq.Workplane().cylinder(10, 4).val(), tmp_path / f"a{suffix}"
    if suffix == ".iges":
        writer = IGESControl_Writer("MM", 1)
        writer.AddShape(shape.wrapped)
        writer.ComputeModel()
        writer.Write(str(path))
    elif suffix == ".brep":
        shape.exportBrep(str(path))
    else:
        cq.exporters.export(cq.Workplane(shape), str(path))
    faces = Brep(path=path).cad_faces("mm")
    assert sum(face.area for face in faces) == pytest.approx(2 * np.pi * 4 * 10 + 2 * np.pi * 16, rel=1e-6)
    (shell,) = (face for face in faces if face.kind in ("cylinder", "surface_of_revolution"))
    assert np.abs(np.array(shell.axis)).tolist() == pytest.approx([0, 0, 1])


def test_the_command_shows_and_prints_them(step: Path) -> None:
    shown = CliRunner().invoke(app, ["faces", str(step)])
    assert shown.exit_code == 0
    assert "seat <A>" in shown.output
    assert re.search(r"axis \(0, 0, -?1\), through \(0, 0, -?\d+\), radius 4 mm, hollow", shown.output)
    printed = CliRunner().invoke(app, ["faces", str(step), "--json", "--units", "inch"])
    said = json.loads(printed.output)
    assert said["units"] == "in"
    assert [face["number"] for face in said["faces"]] == list(range(len(said["faces"])))
    areas = [face.area for face in Brep(path=step).cad_faces("in")]
    assert [face["area"] for face in said["faces"]] == areas
    lines = shown.output.splitlines()
    assert len(lines) == len(areas) + 2, "a line for each face, a head and a foot"


def test_what_has_no_cad_faces_is_refused_with_a_way_out(step: Path, tmp_path: Path) -> None:
    import trimesh

    trimesh.creation.box((1, 1, 1)).export(tmp_path / "box.stl")
    with pytest.raises(InputError, match=r"box\.stl: a mesh has triangles.*STEP, IGES or BREP"):
        CliRunner().invoke(app, ["faces", str(tmp_path / "box.stl")], catch_exceptions=False)
    with pytest.raises(JobError, match="no such file"):
        CliRunner().invoke(app, ["faces", str(tmp_path / "none.step")], catch_exceptions=False)
    (tmp_path / "bad.step").write_bytes(step.read_bytes()[:3000])
    with pytest.raises(InputError, match=r"bad\.step"):
        CliRunner().invoke(app, ["faces", str(tmp_path / "bad.step")], catch_exceptions=False)
