"""CAD files become watertight parts whose volume, unit and faces are those of the CAD model."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damageest_cadquery import damageest_stages
from damageest_cadquery.brep import Brep

from damageest.artefacts import open_edges
from damageest.errors import InputError
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")


@pytest.fixture(scope="module")
def shape() -> Any:
    """A block with rounded edges, a bore, a ball and, apart from it, a ring: planes, cylinders, a sphere, a torus."""
    block = cq.Workplane().box(40, 30, 20).edges("|Z").fillet(4).faces(">Z").workplane().hole(8)
    block = block.union(cq.Workplane().sphere(9).translate((0, 0, 16)))
    ring = cq.Workplane("XZ").circle(3).revolve(360, (-12, 0), (-12, 1)).translate((60, 0, 0))
    return cq.Compound.makeCompound([*block.vals(), *ring.vals()])


def write(shape: Any, path: Path, unit: str = "MM") -> Path:
    from OCP.IGESControl import IGESControl_Writer
    from OCP.Interface import Interface_Static
    from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer

    if path.suffix == ".brep":
        shape.exportBrep(str(path))
    elif path.suffix in (".iges", ".igs"):
        writer = IGESControl_Writer({"MM": "MM", "INCH": "IN"}[unit], 1)
        writer.AddShape(shape.wrapped)
        writer.ComputeModel()
        writer.Write(str(path))
    else:
        writer = STEPControl_Writer()
        Interface_Static.SetCVal_s("write.step.unit", unit)
        writer.Transfer(shape.wrapped, STEPControl_AsIs)
        writer.Write(str(path))
        Interface_Static.SetCVal_s("write.step.unit", "MM")
    return path


def test_the_hook_gives_the_stage() -> None:
    assert damageest_stages() == [Brep]
    assert ".step" in Brep.reads


@pytest.mark.variants(2)
@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *(("a.step", "MM"), ("a.stp", "INCH"), ("a.iges", "MM"), ("a.igs", "INCH"), ("a.brep", "MM")),
    ],
)
def test_volume_and_faces_are_the_models_whatever_the_files_unit(
    name: str, unit: str, shape: Any, tmp_path: Path
) -> None:
    part = Brep(path=write(shape, tmp_path / name, unit)).run(unit="mm", tolerance=0.4)
    assert not open_edges(part.faces)
    assert part.volume == pytest.approx(shape.Volume(), rel=0.01)
    assert part.volume < shape.Volume() * 1.01
    assert 0 < part.tessellation_error < 2 * 0.4 / 8
    assert part.faces_brep is not None
    assert len(part.faces_brep) == len(part.faces)
    assert set(part.face_kinds) == {"plane", "cylinder", "sphere", "torus"}
    assert "2 separate bodies, kept as one part" in part.notes
    assert any("converted from in to mm" in note for note in part.notes) == (unit == "INCH")


def test_the_number_of_a_triangles_cad_face_is_right(shape: Any, tmp_path: Path) -> None:
    part = Brep(path=write(shape, tmp_path / "a.step")).run(unit="mm", tolerance=0.4)
    corners = part.triangles
    for number, kind in enumerate(part.face_kinds):
        mine = corners[part.faces_brep == number].reshape(-1, 3)
        if kind == "plane":
            assert np.linalg.svd(mine - mine.mean(0))[1][2] < 1e-6
        if kind == "sphere":
            np.testing.assert_allclose(np.linalg.norm(mine - [0, 0, 16], axis=1), 9, atol=1e-6)


def test_a_finer_chord_gives_a_smaller_measured_error_and_a_better_volume(shape: Any, tmp_path: Path) -> None:
    path = write(shape, tmp_path / "a.step")
    parts = [Brep(path=path, chord=chord).run(unit="mm", tolerance=None) for chord in (0.8, 0.2, 0.05)]
    errors = [part.tessellation_error for part in parts]
    wrong = [abs(part.volume - shape.Volume()) for part in parts]
    assert errors[0] > errors[1] > errors[2] > 0
    assert wrong[0] > wrong[1] > wrong[2]


def test_units_of_the_job_and_of_the_option(shape: Any, tmp_path: Path) -> None:
    inch = write(shape, tmp_path / "inch.step", "INCH")
    in_inches = Brep(path=inch).run(unit="in", tolerance=0.05)
    assert in_inches.volume * 25.4**3 == pytest.approx(shape.Volume(), rel=0.02)
    told = Brep(path=inch, unit="mm").run(unit="mm", tolerance=0.05)  # the file's numbers, taken for millimetres
    assert told.volume == pytest.approx(in_inches.volume, rel=1e-6)
    brep = write(shape, tmp_path / "a.brep")  # carries no unit: the job's
    assert Brep(path=brep).run(unit="in", tolerance=0.4).volume == pytest.approx(shape.Volume(), rel=0.01)


def test_the_same_file_gives_the_same_part(shape: Any, tmp_path: Path) -> None:
    path = write(shape, tmp_path / "a.step")
    a, b = (Brep(path=path).run(unit="mm", tolerance=0.4) for _ in range(2))
    np.testing.assert_array_equal(a.vertices, b.vertices)
    np.testing.assert_array_equal(a.faces, b.faces)


def test_surfaces_that_close_are_sewn_and_it_is_said(tmp_path: Path) -> None:
    faces = cq.Compound.makeCompound(cq.Workplane().box(3, 4, 5).val().Faces())
    part = Brep(path=write(faces, tmp_path / "skin.step")).run(unit="mm", tolerance=0.1)
    assert part.volume == pytest.approx(60)
    assert any("sewn" in note for note in part.notes)


def test_a_solid_without_faces_is_none(tmp_path: Path) -> None:
    from damageest_cadquery.reading.read import read
    from OCP.BRep import BRep_Builder
    from OCP.TopoDS import TopoDS_Compound, TopoDS_Solid

    builder, whole, empty = BRep_Builder(), TopoDS_Compound(), TopoDS_Solid()
    builder.MakeCompound(whole)
    builder.MakeSolid(empty)
    builder.Add(whole, empty)
    builder.Add(whole, cq.Workplane().box(3, 4, 5).val().wrapped)
    path = write(cq.Compound(whole), tmp_path / "a.brep")
    assert len(read(path, ".brep").solids) == 1
    assert Brep(path=path).run(unit="mm", tolerance=0.1).volume == pytest.approx(60)


def test_an_open_skin_is_refused_with_its_open_edges(tmp_path: Path) -> None:
    faces = cq.Compound.makeCompound(cq.Workplane().box(3, 4, 5).val().Faces()[1:])
    with pytest.raises(InputError, match=r"skin\.step: .*no solid.*4 open edges"):
        Brep(path=write(faces, tmp_path / "skin.step")).run(unit="mm", tolerance=0.1)


@pytest.mark.parametrize("suffix", [".step", ".iges", ".brep"])
@pytest.mark.parametrize("content", [b"", b"nonsense\n", b"ISO-10303-21;\nHEADER;\nENDSEC;\n", bytes(range(256))])
def test_what_is_no_cad_file_is_refused_by_name(suffix: str, content: bytes, tmp_path: Path) -> None:
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match="bad"):
        Brep(path=path).run(unit="mm", tolerance=0.1)


def test_a_file_cut_short_is_refused(shape: Any, tmp_path: Path) -> None:
    path = write(shape, tmp_path / "short.step")
    path.write_bytes(path.read_bytes()[:4000])
    with pytest.raises(InputError, match=r"short\.step"):
        Brep(path=path).run(unit="mm", tolerance=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "extents"),
    [
        pytest.param("featuretype.STEP", (127, 63.5, 34.9), marks=pytest.mark.slow),
        ("nist_ctc_01_asme1_ap242-e1.stp", (800, 450, 150)),
    ],
)
def test_real_files_are_watertight(name: str, extents: tuple[float, ...]) -> None:
    folder = os.environ.get("DAMAGEEST_REAL_DATA")
    if not folder:
        pytest.skip("DAMAGEEST_REAL_DATA does not name the folder of real inputs")
    part = Brep(path=Path(folder) / name).run(unit="mm", tolerance=None)
    np.testing.assert_allclose(sorted(np.ptp(part.vertices, axis=0), reverse=True), extents, atol=0.1)
    assert part.faces_brep is not None
    assert part.tessellation_error < 5e-4 * part.diagonal  # a spline of the first is hard on the mesher; it is told
    assert part.tessellation_error < 7.5e-5 * part.diagonal or any("from the CAD surface" in n for n in part.notes)


def make_cut_ball(claim: float) -> Any:
    """A ball with a small flat, smaller than the tolerance that its edges claim: OpenCASCADE leaves it out, and makes
    triangles half a millimetre off beside it."""
    from OCP.ShapeFix import ShapeFix_ShapeTolerance

    ball = cq.Workplane().sphere(10).cut(cq.Workplane().box(30, 30, 30).translate((0, 0, 24.9999))).val()
    ShapeFix_ShapeTolerance().SetTolerance(ball.wrapped, claim)
    return ball


def test_a_face_that_is_left_out_is_triangulated_with_other_settings(tmp_path: Path) -> None:
    ball = make_cut_ball(0.3)
    part = Brep(path=write(ball, tmp_path / "ball.brep")).run("mm", 0.25)
    assert part.volume == pytest.approx(ball.Volume(), rel=0.004)
    assert part.face_kinds == ("sphere", "plane")
    assert part.faces_brep is not None
    assert set(part.faces_brep.tolist()) == {0, 1}


def test_faces_without_triangles_are_named_where_the_part_stays_open(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from damageest_cadquery.reading import _mesh
    from damageest_cadquery.reading.read import explore
    from OCP.BRepTools import BRepTools
    from OCP.TopAbs import TopAbs_FACE

    mesh = _mesh._mesh

    def leave_out(solid: Any, settings: Any) -> None:
        mesh(solid, settings)
        BRepTools.Clean_s(list(explore(solid, TopAbs_FACE))[4])

    monkeypatch.setattr(_mesh, "_mesh", leave_out)
    path = write(cq.Workplane().box(20, 20, 10).val(), tmp_path / "box.brep")
    with pytest.raises(
        InputError, match=r"box.brep: 1 of its faces get no triangles .*face 4, a plane near \(-10"
    ) as told:
        Brep(path=path).run("mm", 0.25)
    assert str(told.value).count("box.brep") == 1
