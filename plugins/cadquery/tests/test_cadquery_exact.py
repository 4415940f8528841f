"""Damage volumes with the CAD's own faces: what is in the files, and what is said where there is no exact form."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cadquery_faults
import numpy as np
import pytest
from damageest_cadquery import exact
from damageest_cadquery._kept import keep_made
from damageest_cadquery._request import Made
from damageest_cadquery.reading.read import read
from damageest_cadquery.solids.split import measure_volume
from damageest_cadquery.writing.assembly import NamedShape, write_assembly

import damageest
from damageest.errors import InputError
from damageest.isolation import ProcessError
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export import Body, ExactForm, ExportedFiles
from damageest.stages.export.files import Files
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

GREEN = (20, 160, 60)
BALL = {"tool": "sphere", "centre": [2, 10, 6], "radius": 5.5}
NOTCH = {"tool": "box", "centre": [15, 0, 6], "size": [8, 5, 6]}


@dataclass(frozen=True)
class Run:
    result: Result
    folder: Path
    said: dict[str, Any]

    def site(self, form: str) -> dict[str, Any]:
        return next(site for site in self.said["sites"] if site["exact"]["form"] == form)


def write_part(path: Path) -> None:
    """A block with a bore; each face but the top has a name, and the top a colour."""
    shape = cq.Workplane().box(30, 20, 12).faces(">Z").workplane().pushPoints([(-8, 0)]).hole(6).val()
    names = ["" if face.Center().z > 5.9 else f"side {k}" for k, face in enumerate(shape.Faces())]
    top = [GREEN if face.Center().z > 5.9 else None for face in shape.Faces()]
    write_assembly(path, "block", [NamedShape("block", shape.wrapped, (90, 90, 90), names, top)], "mm")


def run(folder: Path, part: Path, *settings: str, damage: Any = (BALL, NOTCH)) -> Run:
    job = {
        "version": 1, "units": "mm", "tolerance": 0.2, "part": str(part), "align": "none", "report": "none",
        "scan": {"use": "simulate", "points": 25000, "noise": 0.04, "seed": 4, "damage": list(damage)},
        "export": {"format": ["step"]},
    }  # fmt: skip
    result = damageest.run(job, output=folder, settings=settings)
    return Run(result, folder, json.loads((folder / "result.json").read_text()))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Run:
    place = tmp_path_factory.mktemp("exact")
    write_part(place / "block.step")
    return run(place / "out", place / "block.step")


def take_solids(path: Path) -> list[Any]:
    return list(cq.importers.importStep(str(path)).solids().vals())


def test_a_ball_mark_is_a_sphere_and_a_notch_is_planes(done: Run) -> None:
    assert [site["exact"]["form"] for site in done.said["sites"]] == ["shapes", "shapes"]
    ball, notch = sorted(
        (take_solids(done.folder / f"damage/site-{k}.step") for k in (1, 2)), key=lambda s: len(s[0].Faces())
    )
    assert [len(ball), len(notch)] == [1, 1]
    assert ball[0].isValid()
    assert notch[0].isValid()
    assert sorted(face.geomType() for face in ball[0].Faces()) == ["PLANE", "PLANE", "SPHERE"]
    assert {face.geomType() for face in notch[0].Faces()} == {"PLANE"}
    assert len(notch[0].Faces()) == 6
    truth = done.result.scan.truth
    assert truth is not None
    assert truth.damage is not None
    assert ball[0].Volume() + notch[0].Volume() == pytest.approx(truth.damage.volume, rel=0.02)


def test_outer_faces_keep_names_and_colours(done: Run) -> None:
    from damageest_cadquery.reading.colours import read_colours
    from damageest_cadquery.reading.list_faces import list_faces

    path = done.folder / "damage/site-1.step"
    listed = list_faces(read(path, ".step"), 1.0)
    colours = read_colours(path, len(listed))
    outer = [face for face in listed if face.name.startswith(("side ", "face "))]
    inner = [face for face in listed if "inner" in face.name]
    assert len(outer) + len(inner) == len(listed)
    (top,) = (face for face in outer if face.normal and face.normal[2] > 0.99)
    assert colours[top.number] == GREEN
    part = list_faces(read(Path(done.result.part.path), ".step"), 1.0)
    number = next(face.number for face in part if face.normal and face.normal[2] > 0.99)
    assert top.name == f"face {number}", "without a name in the file it is called by its number"
    assert {face.name for face in outer if face is not top} <= {face.name for face in part}
    assert all(colours[face.number] != GREEN for face in listed if face is not top)


def test_what_is_left_and_what_is_lost_are_the_part(done: Run) -> None:
    (left,) = take_solids(done.folder / "undamaged.step")
    lost = [solid for k in (1, 2) for solid in take_solids(done.folder / f"damage/site-{k}.step")]
    whole = take_solids(Path(done.result.part.path))[0].Volume()
    assert left.isValid()
    assert left.Volume() + sum(solid.Volume() for solid in lost) == pytest.approx(whole, rel=5e-5)  # slivers


def test_assembly_has_all_by_name_in_ap242(done: Run) -> None:
    text = (done.folder / "result.step").read_text()
    assert "AP242" in text
    assert "1970-01-01" in text
    for name in ("result", "undamaged part", "damage site-1", "damage site-2"):
        assert f"PRODUCT('{name}'" in text
    assert len(take_solids(done.folder / "result.step")) == 3


def test_gmsh_reads_the_same_solids(done: Run) -> None:
    gmsh = load_gmsh()
    gmsh.initialize(readConfigFiles=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for name in ("damage/site-1", "damage/site-2", "damage", "undamaged", "result"):
            gmsh.clear()
            found = [tag for size, tag in gmsh.model.occ.importShapes(str(done.folder / f"{name}.step")) if size == 3]
            solids = take_solids(done.folder / f"{name}.step")
            assert len(found) == len(solids)
            volume = sum(gmsh.model.occ.getMass(3, tag) for tag in found)
            assert volume == pytest.approx(sum(solid.Volume() for solid in solids), rel=1e-4)
    finally:
        gmsh.finalize()


def load_gmsh() -> Any:
    """A reader of STEP of its own; its wheel needs libraries of the system."""
    try:
        import gmsh
    except (ImportError, OSError) as error:
        pytest.skip(f"gmsh cannot be loaded: {error}")
    return gmsh


@pytest.mark.slow
def test_as_cadquery_is_the_same_solid(done: Run) -> None:
    shape = done.result.as_cadquery("damage", 1)
    assert measure_volume(shape.wrapped) == pytest.approx(done.said["sites"][0]["exact"]["volume"], rel=1e-6)


def test_as_cadquery_names_the_sites_that_there_are(done: Run) -> None:
    with pytest.raises(ValueError, match="there are: 1, 2"):
        done.result.as_cadquery("damage", 7)


def export_again(result: Result, folder: Path, **options: Any) -> ExportedFiles:
    folder.mkdir()
    stage = Files.model_validate({"format": ["step"], **options})
    return stage.run(result, folder, Registry.discover().writers)


@pytest.mark.slow
def test_a_site_that_takes_too_long_gets_facets_and_says_so(
    done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", cadquery_faults.compute_on_at_first)
    one = replace(done.result, sites=done.result.sites[:1])
    late = export_again(one, tmp_path / "late", limit=2)
    assert {form.form for form in late.exact.values()} == {"none"}
    assert "longer than 2 s" in late.exact[1].tried[0]
    assert any("site-1.step has facets" in warning for warning in late.warnings)
    (solid,) = take_solids(tmp_path / "late/damage/site-1.step")
    assert solid.Volume() == pytest.approx(done.result.sites[0].damage.volume, rel=0.01)
    assert len(solid.Faces()) > 20


def test_what_was_found_and_written_survives_the_end_of_the_time(
    done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One budget for the run: of a process that is ended when it is used up, what it had done counts. The next gets
    what is left of the time. With a process that is not started."""
    from damageest.isolation import Usage

    left: list[float] = []

    def use_up(_: Any, arguments: dict[str, Any], **more: Any) -> Made:
        request = arguments["request"]
        left.append(request.left)
        assert more["limits"].seconds == request.left
        more["tell"](Usage(40.0, None))
        if len(left) == 1:
            raise ProcessError("crash", "its process ended by an abort (SIGABRT)")
        keep_made(request.keep, Made(("damage/site-1.step",), (), {1: ExactForm("planes", 9)}))
        raise ProcessError("time", "was ended")

    monkeypatch.setattr(exact, "call_isolated", use_up)
    monkeypatch.setattr(exact, "find_place", lambda _: f"spline for site {len(left)}")
    bodies = {"damage/site-1": Body("damage", done.result.sites[0].damage, (9, 9, 9))}
    told = exact.write_exact(tmp_path, done.result, bodies, {"": None}, 60, 80)
    assert left == [80, 40]
    assert any(note.startswith("result.step was not written: the time") for note in told.warnings)
    assert told.files == ("damage/site-1.step",)
    assert {number: form.form for number, form in told.exact.items()} == {
        1: "planes", **{site.id: "none" for site in done.result.sites[1:]}
    }  # fmt: skip
    assert any("(export.exact_seconds) was used up: 80 s" in note for note in told.warnings)


@pytest.mark.slow
def test_sites_that_the_budget_does_not_reach_get_facets(done: Run, tmp_path: Path) -> None:
    """With processes: the first site takes all of the time."""
    before = time.monotonic()
    late = export_again(done.result, tmp_path / "late", exact_seconds=3)
    assert time.monotonic() - before < 120, "on a busy machine"
    assert "none" in {form.form for form in late.exact.values()}
    assert any("export.exact_seconds" in warning for warning in late.warnings)
    for site in done.result.sites:
        (solid,) = take_solids(tmp_path / f"late/damage/site-{site.id}.step")
        assert solid.Volume() == pytest.approx(site.damage.volume, rel=0.01)


def test_what_stops_opencascade_is_left_out_at_the_next_start(
    done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a process that is not started; the slow tests below start it."""
    asked, places = [], iter(["shapes for site 1", "site 2"])

    def stop_twice(_: Any, arguments: dict[str, Any], **__: Any) -> Made:
        asked.append(dict(arguments["request"].skipped))
        if len(asked) < 3:
            raise ProcessError("crash", "its process ended by an abort (SIGABRT)")
        return Made((), (), {})

    monkeypatch.setattr(exact, "call_isolated", stop_twice)
    monkeypatch.setattr(exact, "find_place", lambda _: next(places))
    told = exact.write_exact(tmp_path, done.result, {}, {"": None}, 6)
    why = "OpenCASCADE stopped (its process ended by an abort (SIGABRT))"
    assert asked == [{}, {"shapes for site 1": why}, {"shapes for site 1": why, "site 2": why}]
    assert told.exact is not None
    assert (told.exact[2].form, told.exact[2].tried) == ("none", (why,))
    assert f"site-2.step has facets, not the faces of the CAD file: {why}" in told.warnings


@pytest.mark.variants(slow=1)
@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (cadquery_faults.abort_at_second, "OpenCASCADE stopped (its process ended by an abort (SIGABRT))"),
        (cadquery_faults.raise_at_second, "OpenCASCADE stopped (RuntimeError: Standard_NoSuchObject)"),
    ],
    ids=["abort", "raise"],
)
def test_a_fault_of_opencascade_costs_only_the_exact_form(
    fault: Any, text: str, done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", fault)
    told = export_again(done.result, tmp_path / "out")
    assert [told.exact[k].form for k in (1, 2)] == ["shapes", "none"]
    assert told.exact[2].tried == (text,)
    assert (tmp_path / "out/damage/site-2.step").is_file()
    assert (tmp_path / "out/undamaged.step").is_file()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "text"),
    [
        (cadquery_faults.abort_with_shapes, "shapes 2: OpenCASCADE stopped (its process ended by an abort (SIGABRT))"),
        (cadquery_faults.compute_on_with_shapes, "shapes 2: OpenCASCADE took longer than "),
    ],
    ids=["abort", "time"],
)
def test_a_form_that_stops_opencascade_costs_only_this_form(
    fault: Any, text: str, done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", fault)
    one = replace(done.result, sites=done.result.sites[:1])
    told = export_again(one, tmp_path / "out", limit=6).exact[1]
    assert told.form not in ("none", "shapes")
    assert told.tried[0].startswith(text)
    (solid,) = take_solids(tmp_path / "out/damage/site-1.step")
    assert solid.Volume() == pytest.approx(one.sites[0].damage.volume, rel=3e-3)


@pytest.mark.nightly
@pytest.mark.slow
def test_a_site_that_stops_opencascade_again_and_again_costs_no_other(
    done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", cadquery_faults.abort_with_any)
    told = export_again(done.result, tmp_path / "out")
    assert [told.exact[k].form for k in (1, 2)] == ["none", "shapes"]
    assert "SIGABRT" in told.exact[1].tried[0]


@pytest.mark.slow
def test_opencascade_that_never_starts_costs_all_exact_forms(
    done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", cadquery_faults.abort_at_start)
    told = export_again(done.result, tmp_path / "out")
    assert [told.exact[k].form for k in (1, 2)] == ["none", "none"]
    assert all("SIGABRT" in told.exact[k].tried[0] for k in (1, 2))
    assert (tmp_path / "out/damage/site-2.step").is_file()


@pytest.mark.slow
def test_the_same_job_gives_the_same_bytes(done: Run, tmp_path: Path) -> None:
    again = run(tmp_path / "again", Path(done.result.part.path))
    names = sorted(path.relative_to(done.folder) for path in done.folder.rglob("*.step"))
    assert names
    assert all((done.folder / name).read_bytes() == (again.folder / name).read_bytes() for name in names)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["brep", "iges"])
def test_other_formats(done: Run, tmp_path: Path, suffix: str) -> None:
    shape = cq.importers.importStep(done.result.part.path).val()
    part = tmp_path / f"block.{suffix}"
    if suffix == "brep":
        shape.exportBrep(str(part))
    else:
        from OCP.IGESControl import IGESControl_Writer

        writer = IGESControl_Writer("MM", 1)
        writer.AddShape(shape.wrapped)
        writer.ComputeModel()
        writer.Write(str(part))
    other = run(tmp_path / "out", part)
    assert [site["exact"]["form"] for site in other.said["sites"]] == ["shapes", "shapes"]


@pytest.mark.slow
def test_solids_of_an_assembly_stay_apart(tmp_path: Path) -> None:
    first = cq.Workplane().box(20, 20, 12).val()
    second = cq.Workplane().box(14, 20, 12).translate((22, 0, 0)).val()
    shapes = [NamedShape("left", first.wrapped, (9, 9, 9)), NamedShape("right", second.wrapped, GREEN)]
    write_assembly(tmp_path / "two.step", "pair", shapes, "mm")
    ball = {"tool": "sphere", "centre": [10, 10, 6], "radius": 4}
    both = run(tmp_path / "out", tmp_path / "two.step", damage=[ball])
    assert len(take_solids(both.folder / "undamaged.step")) == 2
    text = (both.folder / "result.step").read_text()
    assert "PRODUCT('undamaged left'" in text
    assert "PRODUCT('undamaged right'" in text


@pytest.mark.slow
def test_a_blob_is_one_spline_or_few_facets(done: Run, tmp_path: Path) -> None:
    blob = {"tool": "blob", "centre": [15, 10, 6], "radius": 5, "seed": 3}
    rough = run(tmp_path / "out", Path(done.result.part.path), damage=[blob])
    exact = rough.said["sites"][0]["exact"]
    assert exact["form"] in ("spline", "facets")
    assert exact["faces"] < 500
    assert exact["volume"] == pytest.approx(rough.said["sites"][0]["volume"], rel=3e-3)


@pytest.mark.slow
def test_a_mesh_has_no_exact_form(done: Run, tmp_path: Path) -> None:
    meshed = replace(done.result, part=replace(done.result.part, cad_scale=0.0))
    told = export_again(meshed, tmp_path / "out", solids="exact")
    assert any("without CAD faces" in warning for warning in told.warnings)
    assert (tmp_path / "out/damage/site-1.step").is_file()
    with pytest.raises(InputError, match="is a mesh"):
        meshed.as_cadquery("part")


def test_a_wrong_volume_is_refused(done: Run) -> None:
    from damageest_cadquery.cutting.check_pieces import Target, check_pieces
    from damageest_cadquery.cutting.exact_damage import start_solids

    part = done.result.part
    solids, faces = start_solids(read(Path(part.path), ".step").solids)
    site = done.result.sites[0]
    target = Target(site.damage, site.surface, np.empty((0, 3)), part, done.result.tolerance, faces)
    found = check_pieces("facets", solids, 0.0, 1, target)
    assert "volume differs" in found.reason


@pytest.mark.slow
def test_the_example_job_is_exact(tmp_path: Path) -> None:
    """The ball mark is one sphere; no site is without an exact form."""
    job = Path(__file__).parents[3] / "jobs" / "gear_exact.yaml"
    damageest.run(job, output=tmp_path / "out", settings=("report=none",))
    said = json.loads((tmp_path / "out/result.json").read_text())
    forms = [site["exact"]["form"] for site in said["sites"]]
    assert len(forms) == 3
    assert "none" not in forms
    assert all(site["exact"]["volume"] == pytest.approx(site["volume"], rel=3e-3) for site in said["sites"])
    ball = next(site for site in said["sites"] if site["exact"]["form"] == "shapes")
    (mark,) = take_solids(tmp_path / f"out/damage/site-{ball['id']}.step")
    assert "SPHERE" in {face.geomType() for face in mark.Faces()}
