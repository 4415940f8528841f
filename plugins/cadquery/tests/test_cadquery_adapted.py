"""Exact solids of a part that was adapted to its scan: the CAD's faces are moved with it."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cadquery_faults
import numpy as np
import pytest
import trimesh
from damageest_cadquery import exact
from damageest_cadquery.solids.split import measure_volume, triangulate

import damageest
from damageest.artefacts import Floats, Mesh, Solid
from damageest.errors import InputError
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.solids import iou
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest.stages.export.files import Files
from tests.needs import import_for, needs_plugin

pytestmark = [needs_plugin("cadquery"), pytest.mark.slow]
cq = import_for("cadquery", "cadquery")

TOLERANCE = 0.2
BALL = {"tool": "sphere", "centre": [10, 3, 6], "radius": 5.5}


@dataclass(frozen=True)
class Run:
    result: Result
    folder: Path
    said: dict[str, Any]


def run(folder: Path, part: Path, *settings: str) -> Run:
    job = {
        "version": 1, "units": "mm", "tolerance": TOLERANCE, "part": str(part), "align": "none", "report": "none",
        "scan": {
            "use": "simulate", "points": 16000, "noise": 0.03, "seed": 4, "damage": [BALL],
            "deform": {"bend": 1.0},
        },
        "adapt": {"use": "smooth", "points": 4000, "lattice": []},
        "export": {"format": ["step", "ply"], "frame": "both"},
    }  # fmt: skip
    result = damageest.run(job, output=folder, settings=settings)
    return Run(result, folder, json.loads((folder / "result.json").read_text()))


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Run:
    place = tmp_path_factory.mktemp("adapted")
    shape = cq.Workplane().box(60, 20, 12).faces(">Z").workplane().pushPoints([(-8, 0)]).hole(6)
    cq.exporters.export(shape, str(place / "bar.step"))
    return run(place / "out", place / "bar.step")


def take_solids(path: Path) -> list[Any]:
    return list(cq.importers.importStep(str(path)).solids().vals())


def sample(shape: Any, chord: float = 0.05) -> Floats:
    vertices, _ = shape.tessellate(chord, 0.3)
    return np.array([vertex.toTuple() for vertex in vertices])


def test_sites_of_a_bent_part_keep_few_exact_faces(done: Run) -> None:
    assert done.result.adapted is not None
    assert done.result.adapted.amount > 2 * TOLERANCE, "bent by more than the tolerance"
    (site,) = done.said["sites"]
    assert site["exact"]["form"] in ("shapes", "spline"), site["exact"]["tried"]
    (solid,) = take_solids(done.folder / "damage/site-1.step")
    assert solid.isValid()
    kinds = [face.geomType() for face in solid.Faces()]
    assert len(kinds) == 2
    assert "BSPLINE" in kinds
    assert measure_volume(solid.wrapped) == pytest.approx(site["volume"], rel=0.005)


def test_what_is_left_has_the_moved_faces_of_the_part(done: Run) -> None:
    assert done.result.undamaged is not None
    (left,) = take_solids(done.folder / "undamaged.step")
    assert left.isValid()
    assert len(left.Faces()) == 8
    assert measure_volume(left.wrapped) == pytest.approx(done.result.undamaged.volume, rel=0.003)


def test_the_part_itself_is_the_adapted_one(done: Run) -> None:
    shape, result = done.result.as_cadquery("part"), done.result
    assert result.adapted is not None
    assert result.adapted.field is not None
    assert shape.isValid()
    assert [face.geomType() for face in shape.Faces()] == ["BSPLINE"] * 7
    off = distance_to_mesh(sample(shape), result.part)
    assert off.max() < TOLERANCE / 10 + result.part.tessellation_error
    nominal = cq.importers.importStep(result.part.path)
    moved = result.adapted.field.move(sample(nominal.val()))
    near = np.array([cq.Vertex.makeVertex(*place).distance(shape.Shells()[0]) for place in moved[::5].tolist()])
    assert near.max() < TOLERANCE / 10, "the faces follow the field, not the triangles"
    assert measure_volume(shape.wrapped) == pytest.approx(result.part.volume, rel=0.003)


def test_faces_keep_their_names(done: Run) -> None:
    from damageest_cadquery.reading.list_faces import list_faces
    from damageest_cadquery.reading.read import read

    names = {face.name for face in list_faces(read(done.folder / "undamaged.step", ".step"), 1.0)}
    assert {f"face {k}" for k in range(7)} <= names


def test_files_in_the_scan_frame_lie_where_the_scan_is(done: Run) -> None:
    truth = done.result.scan.truth
    assert truth is not None
    assert truth.deformed is not None
    (solid,) = take_solids(done.folder / "scan_frame/damage/site-1.step")
    assert iou(triangulate(solid.wrapped, 0.02), truth.deformed) > 0.98
    left = trimesh.load(done.folder / "scan_frame/undamaged.ply", process=False)
    assert iou(Solid(left.vertices, left.faces), truth.deformed) < 1e-3
    there = trimesh.load(done.folder / "scan_frame/scan.ply", process=False).vertices
    assert np.allclose(there, done.result.scan.points)
    intact = done.result.deviation.label == 0
    assert np.median(distance_to_mesh(there[intact], Mesh(left.vertices, left.faces))) < TOLERANCE / 4


def test_without_a_field_sites_have_facets_and_the_part_is_refused(done: Run, tmp_path: Path) -> None:
    assert done.result.adapted is not None
    blind = replace(done.result, adapted=replace(done.result.adapted, field=None))
    written = write(blind, tmp_path)
    assert not written.exact
    assert any("displacement field" in note for note in written.warnings)
    for what, site in (("part", None), ("undamaged", None), ("damage", 1)):
        with pytest.raises(InputError, match="displacement field"):
            blind.as_cadquery(what, site)


def test_a_field_that_is_not_that_of_the_mesh_is_refused(done: Run, tmp_path: Path) -> None:
    adapted = done.result.adapted
    assert adapted is not None
    assert adapted.field is not None
    other = replace(adapted.field, controls=adapted.field.controls + np.array([0, 0, TOLERANCE]))
    wrong = replace(done.result, adapted=replace(adapted, field=other))
    written = write(wrong, tmp_path)
    assert [form.form for form in written.exact.values()] == ["none"]
    assert all("off the adapted part" in form.tried[-1] for form in written.exact.values())
    assert "damage/site-1.step" in written.files


def test_faces_that_take_too_long_to_move_cost_the_exact_form(
    done: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(exact, "make_exact", cadquery_faults.compute_on_while_adapting)
    written = write(done.result, tmp_path, limit=2)
    assert written.exact[1].form == "none"
    assert "longer than 2 s with the CAD faces of the adapted part" in written.exact[1].tried[0]
    assert any("site-1.step has facets" in warning for warning in written.warnings)
    assert "damage/site-1.step" in written.files


def test_the_field_is_in_the_unit_of_the_job(done: Run) -> None:
    """The CAD file is in millimetres, this result in centimetres."""
    mm, adapted = done.result, done.result.adapted
    assert adapted is not None
    assert adapted.field is not None
    part = replace(
        mm.part, vertices=mm.part.vertices / 10, unit="cm", cad_scale=0.1,
        tessellation_error=mm.part.tessellation_error / 10,
    )  # fmt: skip
    field = adapted.field
    smaller = replace(field, low=field.low / 10, high=field.high / 10, controls=field.controls / 10)
    moved = replace(adapted, part=part, field=smaller)
    cm = replace(mm, units="cm", tolerance=TOLERANCE / 10, part=part, adapted=moved, sites=())
    shape = cm.as_cadquery("undamaged")
    assert shape.isValid()
    assert distance_to_mesh(sample(shape, 0.005), part).max() < TOLERANCE / 100 + part.tessellation_error
    assert measure_volume(shape.wrapped) == pytest.approx(part.volume, rel=0.003)


def write(result: Result, folder: Path, **options: object) -> ExportedFiles:
    """The damage volumes as STEP. What is left of the part has many facets, which take long."""
    folder.mkdir(exist_ok=True)
    sites = replace(result, undamaged=None, damage=None)
    stage = Files.model_validate({"format": ["step"], "solids": "exact", "detail": 0.3, **options})
    return stage.run(sites, folder, Registry.discover().writers, {})
