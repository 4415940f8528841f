"""What a STEP file holds when it is read back: every solid, closed and valid, with its volume, names and colours."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Solid
from damageest.geometry.solids import to_arrays
from damageest.stages.export import Body
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

GREY, GREEN = (90, 90, 90), (20, 160, 60)
HEIGHT = 0.5


def make_wave(multiplicity: int, height: float) -> Any:
    """A spline face over 10 x 10, cubic with one inner knot of a ``multiplicity``; with 3 it has a crease."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
    from OCP.Geom import Geom_BSplineSurface
    from OCP.gp import gp_Pnt
    from OCP.TColgp import TColgp_Array2OfPnt
    from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

    rows = 4 + multiplicity
    poles = TColgp_Array2OfPnt(1, rows, 1, 4)
    for i, x in enumerate(np.linspace(0, 10, rows).tolist()):
        for j in range(4):
            poles.SetValue(i + 1, j + 1, gp_Pnt(x, 10 * j / 3, height * np.sin(x) + 0.06 * j * (j - 3)))
    arrays = []
    for knots, times in (((0.0, 0.5, 1.0), (4, multiplicity, 4)), ((0.0, 1.0), (4, 4))):
        values, counts = TColStd_Array1OfReal(1, len(knots)), TColStd_Array1OfInteger(1, len(knots))
        for k, (knot, time) in enumerate(zip(knots, times, strict=True), 1):
            values.SetValue(k, knot)
            counts.SetValue(k, time)
        arrays.append((values, counts))
    (u, u_times), (v, v_times) = arrays
    surface = Geom_BSplineSurface(poles, u, v, u_times, v_times, 3, 3)
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


def name(shape: Any, title: str) -> Any:
    from damageest_cadquery.solids.joining import explore_faces
    from damageest_cadquery.writing.assembly import NamedShape

    count = len(explore_faces(shape))
    return NamedShape(title, shape, GREY, [f"{title} {k}" for k in range(count)], [GREEN] * count)


def write(folder: Path, shapes: list[Any]) -> tuple[Any, Path]:
    from damageest_cadquery.writing.write_shapes import write_shapes

    (folder / "scratch").mkdir()
    done = write_shapes(folder / "scratch/a.step", folder / "a.step", "all", shapes, "mm", 0.02)
    return done, folder / "a.step"


def take_solids(path: Path) -> list[Any]:
    solids = list(cq.importers.importStep(str(path)).solids().vals())
    assert all(solid.isValid() and all(shell.wrapped.Closed() for shell in solid.Shells()) for solid in solids)
    return solids


@pytest.mark.parametrize(("multiplicity", "height"), [(1, 1.0), pytest.param(3, 0.03, marks=pytest.mark.slow)])
def test_stock_on_a_spline_is_a_solid_in_the_file(multiplicity: int, height: float, tmp_path: Path) -> None:
    """OpenCASCADE writes the offset of a surface with a crease, and does not read it: the solid would be lost."""
    from damageest_cadquery.solids.split import measure_volume
    from damageest_cadquery.stock.offset_faces import _thicken

    stock = _thicken([make_wave(multiplicity, height)], HEIGHT)
    block = cq.Workplane().box(2, 3, 4).translate((30, 0, 0)).val().wrapped
    done, path = write(tmp_path, [name(block, "block"), name(stock, "stock")])
    if multiplicity == 1:
        assert done.said == ""
    else:
        assert done.said.startswith("was written with its offset faces as splines: read back before, ")
    volumes = sorted(measure_volume(solid.wrapped) for solid in take_solids(path))
    assert volumes == pytest.approx([24, measure_volume(stock)], rel=1e-3)
    assert set(list_names(path)) == {f"{title} {k}" for title in ("block", "stock") for k in range(6)}


@pytest.mark.slow
def test_stock_that_no_way_can_write_is_left_out_and_said(tmp_path: Path) -> None:
    """Over a deep crease the offset has a gap, as a spline too, and its triangles do not close."""
    from damageest_cadquery.stock.offset_faces import _thicken

    done, path = write(tmp_path, [name(_thicken([make_wave(3, 1.0)], HEIGHT), "stock")])
    assert done.made is None
    assert done.said == "was not written: read back, it holds 0 solids for 1"
    assert not path.exists()


@pytest.mark.slow
def test_only_the_solid_that_cannot_be_written_gets_facets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A writer that loses one solid as long as it has CAD faces."""
    from damageest_cadquery.writing import write_shapes as _files

    whole, spare = _files._write, name(cq.Workplane().box(1, 1, 1).val().wrapped, "spare")

    def lose(title: str, unit: str, curves: bool, path: Path, shapes: list[Any]) -> None:
        whole(
            title, unit, curves, path, [each for each in shapes if each.name != "bad" or not each.names[0]] or [spare]
        )

    monkeypatch.setattr(_files, "_write", lose)
    ball, pin = cq.Workplane().sphere(3).val().wrapped, cq.Workplane().circle(2).extrude(5).val().wrapped
    done, path = write(tmp_path, [name(ball, "good"), name(pin, "bad")])
    assert "was written with facets on the solids that OpenCASCADE does not read back" in done.said
    assert "it holds 1 solids for 2" in done.said
    names = list_names(path)
    assert names.count("good 0") == 1
    assert names.count("") > 20
    volumes = sorted(solid.Volume() for solid in take_solids(path))
    assert volumes == pytest.approx([20 * np.pi, 36 * np.pi], rel=1e-3)


def list_names(path: Path) -> list[str]:
    from damageest_cadquery.reading.list_faces import list_faces
    from damageest_cadquery.reading.read import read

    return [face.name for face in list_faces(read(path, ".step"), 1.0)]


def test_a_file_without_what_it_is_to_hold_is_not_moved(tmp_path: Path) -> None:
    """Every way gives another fault, and none of them a file."""
    from damageest_cadquery.writing.step import Way, write_first, write_shape
    from damageest_cadquery.writing.write_shapes import join_shapes

    box = cq.Workplane().box(1, 2, 3).val()
    shapes = {
        "one of two": cq.Workplane().box(1, 2, 3).translate((5, 0, 0)).val().wrapped,
        "open": cq.Shell.makeShell(box.Faces()[1:]).wrapped,
        "larger": cq.Workplane().box(1, 2, 3.01).val().wrapped,
    }
    wanted = {
        "one of two": join_shapes([box.wrapped, shapes["one of two"]]),
        "open": box.wrapped,
        "larger": box.wrapped,
    }

    def way(what: str) -> Any:
        return Way(
            what,
            lambda: what,
            lambda path, _: write_shape(path, shapes[what], what, "mm"),
            lambda _: wanted[what],
        )

    scratch = tmp_path / "scratch.step"
    for what, fault in (("one of two", "1 solids for 2"), ("open", "0 solids for 1"), ("larger", "differs by 0.33%")):
        done = write_first(scratch, tmp_path / "a.step", [way(what)])
        assert done.made is None
        assert fault in done.said
        assert not (tmp_path / "a.step").exists()
    done = write_first(scratch, tmp_path / "a.step", [way("larger"), Way("right", lambda: box.wrapped, copy)])
    assert done.said.startswith("was written right: read back before, the volume")
    assert take_solids(tmp_path / "a.step")[0].Volume() == pytest.approx(6)


def test_a_file_that_others_may_refuse_has_another_name(tmp_path: Path) -> None:
    """All volume is in it, in one solid for two: a reader that looks for a file of the usual name finds none."""
    from damageest_cadquery.writing.step import Way, write_first

    two = cq.Workplane().box(2, 2, 2).union(cq.Workplane().box(2, 2, 2).translate((2, 0, 0)), clean=True).val()
    halves = cq.Compound.makeCompound([cq.Workplane().box(2, 2, 2).translate((k, 0, 0)).val() for k in (0, 2)])
    way = Way("as it is", lambda: two.wrapped, copy, lambda _: halves.wrapped)
    done = write_first(tmp_path / "scratch.step", tmp_path / "a.step", [way])
    assert not done.is_valid
    assert "is called a-invalid.step, since other programs may refuse it: read back, it holds 1 solids" in done.said
    assert [path.name for path in tmp_path.iterdir()] == ["a-invalid.step"]


def copy(path: Path, shape: Any) -> None:
    from damageest_cadquery.writing.step import write_shape

    write_shape(path, shape, "copy", "mm")


def move_faces() -> Any:
    """A solid whose shell and top face have places of their own, as some programs write BREP."""
    from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
    from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
    from OCP.TopLoc import TopLoc_Location

    outline = cq.Workplane().rect(4, 3).extrude(1).faces("<Z").val()
    move = gp_Trsf()
    move.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 0)), 0.4)
    placed = outline.wrapped.Moved(TopLoc_Location(move))
    return BRepPrimAPI_MakePrism(placed, gp_Vec(1, 0, -5), False, True).Shape()


def test_faces_with_a_place_of_their_own_keep_names_and_colours(tmp_path: Path) -> None:
    from damageest_cadquery.reading.colours import read_colours
    from damageest_cadquery.reading.list_faces import list_faces
    from damageest_cadquery.reading.read import read

    shape = move_faces()
    faces = cq.Shape.cast(shape).Faces()
    assert sum(not face.wrapped.Location().IsIdentity() for face in faces) > 0
    done, path = write(tmp_path, [name(shape, "side"), name(cq.Workplane().box(1, 1, 1).val().wrapped, "cube")])
    assert done.said == ""
    listed = list_faces(read(path, ".step"), 1.0)
    found = {face.name: face.centre for face in listed}
    assert set(found) == {f"{title} {k}" for title in ("side", "cube") for k in range(6)}
    for k, face in enumerate(faces):
        np.testing.assert_allclose(found[f"side {k}"], face.Center().toTuple(), atol=1e-6)
    assert read_colours(path, len(listed)) == [GREEN] * 12


NAMES = ["plain", "deposit site-1 2", "it's 'so'", "a; #7 = PRODUCT(x 1)", "long " * 40 + "end", "back\\slash"]


@pytest.mark.parametrize("title", NAMES)
def test_products_keep_their_four_arguments(title: str, tmp_path: Path) -> None:
    from damageest_cadquery.writing.step import write_shape

    box = cq.Workplane().box(1, 2, 3).val().wrapped
    for number in range(2):  # OpenCASCADE counts the products of a process
        write_shape(tmp_path / f"{number}.step", box, title, "mm")
    _, path = write(tmp_path, [name(box, title), name(cq.Workplane().box(2, 2, 2).val().wrapped, "other 5")])
    for file, titles in ((tmp_path / "0.step", {title}), (path, {title, "all", "other 5"})):
        assert set(read_products(file)) == {(each, each) for each in titles}
        assert "1970-01-01T00:00:00" in file.read_text(encoding="latin-1")[:600]
    assert (tmp_path / "0.step").read_bytes() == (tmp_path / "1.step").read_bytes()


def read_products(path: Path) -> list[tuple[str, str]]:
    """Id and name of each product, as OpenCASCADE reads them; the count of their arguments by the text."""
    from OCP.StepBasic import StepBasic_Product
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    reader.ReadFile(str(path))
    model = reader.WS().Model()
    entities = (model.Value(number) for number in range(1, model.NbEntities() + 1))
    found = [each for each in entities if isinstance(each, StepBasic_Product)]
    text = re.sub(r"'(?:[^']|'')*'", "S", path.read_text(encoding="latin-1").replace("\n", ""))
    assert len(re.findall(r"= PRODUCT\(\s*S\s*,\s*S\s*,\s*S\s*,\s*\(\s*#\d+\s*\)\s*\)", text)) == len(found)
    return [(each.Id().ToCString(), each.Name().ToCString()) for each in found]


def add_sliver(height: float) -> Solid:
    """A cube with a flat piece beside it, as a union of bodies can leave."""
    vertices, faces = to_arrays(Manifold.cube((10, 10, 10)))
    flat = np.array([[20, 0, 0], [23, 0, 0], [20, 4, 0], [21, 1, height]])
    around = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]) + len(vertices)
    return Solid(np.concatenate([vertices, flat]), np.concatenate([faces, around]))


@pytest.mark.parametrize("height", [0.0, 1e-12, 1e-9])
def test_slivers_are_left_out(height: float, tmp_path: Path) -> None:
    from damageest_cadquery.writing.step import write_step

    made = add_sliver(height)
    done = write_step(tmp_path, "a", [Body("a", made, GREY)], "mm")
    assert (done.files, done.notes) == (("a.step",), ())
    assert [solid.Volume() for solid in take_solids(tmp_path / "a.step")] == pytest.approx([1000])


def test_a_needle_has_its_triangles_as_faces() -> None:
    """All of it is one flat region within rounding, which has no outline."""
    from damageest_cadquery.solids.facets import find_facets, straighten

    corners = np.array([[20, 0, 0], [30, 0, 0], [25, 1e-9, 0], [24, 0, 1e-9]])
    needle = Solid(corners, np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]))
    assert [len(facet.loops[0]) for facet in find_facets(needle)] == [3] * 4
    assert straighten([], corners, 1e-9) == []


def test_bodies_that_touch_in_a_point_are_solids_of_their_own(tmp_path: Path) -> None:
    from damageest_cadquery.writing.step import write_step

    vertices, faces = to_arrays(Manifold.cube((10, 10, 10)))
    move = np.array([10, 10, 10])
    both, other = np.concatenate([vertices, vertices + move]), faces + len(vertices)
    for k, place in enumerate(vertices + move):
        (same,) = np.nonzero((vertices == place).all(axis=1))
        other = np.where(other == k + len(vertices), same[0] if len(same) else k + len(vertices), other)
    done = write_step(tmp_path, "a", [Body("a", Solid(both, np.concatenate([faces, other])), GREY)], "mm")
    assert (done.files, done.notes) == (("a.step",), ())
    assert [solid.Volume() for solid in take_solids(tmp_path / "a.step")] == pytest.approx([1000, 1000])


def test_where_integrals_are_wrong_triangles_decide(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As over walls on cones: the same solid has other integrals in the file than before."""
    from damageest_cadquery.writing import readback as _readback
    from damageest_cadquery.writing.assembly import NamedShape, write_assembly

    shapes = [cq.Workplane().box(10, 10, height).val().wrapped for height in (10, 10.1)]
    write_assembly(tmp_path / "a.step", "a", [NamedShape("a", shapes[0], GREY)], "mm")
    assert "volume of a solid" in _readback.find_fault(tmp_path / "a.step", shapes[1])

    def measure(solid: Any) -> float:
        return 1000.0 if solid.IsSame(shapes[0]) else 1010.0

    monkeypatch.setattr(_readback, "measure_quickly", measure)
    monkeypatch.setattr(_readback, "measure_volume", measure)
    assert _readback.find_fault(tmp_path / "a.step", shapes[0]) == ""
