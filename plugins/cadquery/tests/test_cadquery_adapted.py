"""Exact solids of a part that was adapted to its scan: the CAD's faces are moved with it."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import damageest
from damageest.artefacts import Floats
from damageest.errors import InputError
from damageest.geometry.distance import distance_to_mesh
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest.stages.export.files import Files
from tests.needs import import_for, needs_plugin

pytestmark = needs_plugin("cadquery")
cq = import_for("cadquery", "cadquery")

TOLERANCE = 0.2
BALL = {"tool": "sphere", "centre": [10, 3, 6], "radius": 5.5}
NOTCH = {"tool": "box", "centre": [-22, -10, 3], "size": [8, 5, 8]}


@dataclass(frozen=True)
class Run:
    result: Result
    folder: Path
    said: dict[str, Any]


def run(folder: Path, part: Path, *settings: str) -> Run:
    job = {
        "version": 1, "units": "mm", "tolerance": TOLERANCE, "part": str(part), "align": "none", "report": "none",
        "scan": {
            "use": "simulate", "points": 16000, "noise": 0.03, "seed": 4, "damage": [BALL, NOTCH],
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


def sample(shape: Any) -> Floats:
    vertices, _ = shape.tessellate(0.05, 0.3)
    return np.array([vertex.toTuple() for vertex in vertices])


def test_sites_of_a_bent_part_keep_few_exact_faces(done: Run) -> None:
    assert done.result.adapted is not None
    assert done.result.adapted.amount > 2 * TOLERANCE, "bent by more than the tolerance"
    assert len(done.said["sites"]) == 2
    for site in done.said["sites"]:
        assert site["exact"]["form"] in ("shapes", "spline", "planes"), site["exact"]["tried"]
        (solid,) = take_solids(done.folder / f"damage/site-{site['id']}.step")
        assert solid.isValid()
        assert len(solid.Faces()) < 12
        kinds = [face.geomType() for face in solid.Faces()]
        assert kinds.count("BSPLINE") >= len(kinds) - site["exact"]["inner_faces"]
        assert solid.Volume() == pytest.approx(site["volume"], rel=0.01)


def test_what_is_left_has_the_moved_faces_of_the_part(done: Run) -> None:
    assert done.result.undamaged is not None
    (left,) = take_solids(done.folder / "undamaged.step")
    assert left.isValid()
    assert len(left.Faces()) < 20
    assert left.Volume() == pytest.approx(done.result.undamaged.volume, rel=0.003)


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
    assert shape.Volume() == pytest.approx(result.part.volume, rel=0.003)


def test_faces_keep_their_names(done: Run) -> None:
    from damageest_cadquery._faces import list_faces
    from damageest_cadquery._read import read

    names = {face.name for face in list_faces(read(done.folder / "undamaged.step", ".step"), 1.0)}
    assert {f"face {k}" for k in range(7)} <= names


def test_files_in_the_scan_frame_lie_where_the_scan_is(done: Run) -> None:
    truth = done.result.scan.truth
    assert truth is not None
    assert truth.deformed is not None
    for suffix in ("step", "ply"):
        found = np.concatenate([read_points(done.folder / f"scan_frame/damage/site-{k}.{suffix}") for k in (1, 2)])
        assert np.quantile(distance_to_mesh(found, truth.deformed), 0.95) < TOLERANCE / 2
    import trimesh

    there = trimesh.load(done.folder / "scan_frame/scan.ply").vertices
    assert np.allclose(there, done.result.scan.points)


def read_points(path: Path) -> Floats:
    import trimesh

    if path.suffix == ".step":
        return np.concatenate([sample(solid) for solid in take_solids(path)])
    return np.asarray(trimesh.load(path).vertices)


def test_without_a_field_sites_have_facets_and_the_part_is_refused(done: Run, tmp_path: Path) -> None:
    assert done.result.adapted is not None
    blind = replace(done.result, adapted=replace(done.result.adapted, field=None))
    written = write(blind, tmp_path)
    assert not written.exact
    assert any("no field" in note for note in written.warnings)
    for what, site in (("part", None), ("undamaged", None), ("damage", 1)):
        with pytest.raises(InputError, match="no field"):
            blind.as_cadquery(what, site)


def test_a_field_that_is_not_that_of_the_mesh_is_refused(done: Run, tmp_path: Path) -> None:
    adapted = done.result.adapted
    assert adapted is not None
    assert adapted.field is not None
    other = replace(adapted.field, controls=adapted.field.controls + [0, 0, TOLERANCE])
    wrong = replace(done.result, adapted=replace(adapted, field=other))
    written = write(wrong, tmp_path)
    assert [form.form for form in written.exact.values()] == ["none", "none"]
    assert all("off the adapted part" in form.tried[-1] for form in written.exact.values())
    assert {"damage/site-1.step", "damage/site-2.step", "undamaged.step"} <= set(written.files)


def write(result: Result, folder: Path) -> ExportedFiles:
    from damageest.registry import Registry

    folder.mkdir(exist_ok=True)
    return Files(format=("step",), solids="exact").run(result, folder, Registry.discover().writers, {})
