"""Files on the part as designed, where the part was adapted to its scan."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import AdaptedPart, Floats, Solid, Truth, fit_displacement
from damageest.errors import StageError
from damageest.geometry.solids import iou, to_manifold, to_solid
from damageest.io.meshes import read_mesh
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest.stages.export.files import Files
from tests.stages.export import results

TOLERANCE = 0.2
SIZE = np.array([60.0, 20, 12])
BALL = {"tool": "sphere", "centre": [10, 3, 6], "radius": 5.5}


def write(result: Result, folder: Path, **options: object) -> ExportedFiles:
    return Files.model_validate(options).run(result, folder, Registry.discover().writers)


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    place = tmp_path_factory.mktemp("nominal")
    trimesh.creation.box(SIZE).export(place / "bar.stl")
    job = {
        "version": 1, "units": "mm", "tolerance": TOLERANCE, "part": str(place / "bar.stl"), "align": "none",
        "scan": {
            "use": "simulate", "points": 16000, "noise": 0.03, "seed": 4, "damage": [BALL], "deform": {"bend": 1.0},
        },
        "adapt": {"use": "smooth", "points": 4000, "lattice": []}, "report": "none",
        "export": {"format": ["ply"], "frame": "all"},
    }  # fmt: skip
    return damageest.run(job, output=place / "out"), place / "out"


def displace(places: Floats) -> Floats:
    """A bend of the box of `results.make`, by 1 mm at its ends."""
    x, _, z = (places / 20).T
    return np.stack([-2 * x * z, np.zeros(len(x)), x**2], axis=1)


def bend(mesh: Any) -> Any:
    if type(mesh) is Solid:
        mesh = to_solid(to_manifold(mesh).refine_to_length(4.0))
    return replace(mesh, vertices=mesh.vertices + displace(mesh.vertices))


@pytest.fixture(scope="module")
def drawn() -> tuple[Result, Result]:
    """The box with two bites, and the same on a bent box, as if the part had been adapted to it."""
    plain = results.make()
    assert plain.damage is not None
    scan = replace(plain.scan, truth=Truth(plain.damage, plain.pose.T_part_scan))
    plain = replace(plain, scan=scan)
    part, moved = bend(plain.part), displace(plain.part.vertices)
    field = fit_displacement(displace, *plain.part.bounds, (0, 0, 0))
    adapted = AdaptedPart(part, moved, np.eye(4), np.zeros((0, *moved.shape)), 1.0, 0.5, field=field)
    sites = tuple(
        replace(one, damage=bend(one.damage), surface=bend(one.surface), deposit=one.deposit and bend(one.deposit))
        for one in plain.sites
    )
    there = replace(
        plain, part=part, adapted=adapted, sites=sites, damage=bend(plain.damage), undamaged=bend(plain.undamaged)
    )
    return plain, there


def read(path: Path) -> Solid:
    return Solid(*read_mesh(path)[:2])


def measure_off_box(points: Floats) -> Floats:
    """(N,) distance to the skin of the part as designed."""
    over = np.abs(points) - SIZE / 2
    outside = np.linalg.norm(np.maximum(over, 0), axis=1)
    return np.asarray(np.where(outside > 0, outside, -over.max(axis=1)))


@pytest.mark.slow
def test_the_loss_lies_where_it_is_on_the_part_as_designed(bent: tuple[Result, Path]) -> None:
    result, out = bent
    truth = result.scan.truth
    assert truth is not None
    assert truth.damage is not None
    assert truth.deformed is not None
    back, there = read(out / "nominal_frame/damage/site-1.ply"), read(out / "damage/site-1.ply")
    assert iou(back, truth.damage) > 0.97
    assert iou(there, truth.damage) < 0.95, "the bend matters"
    assert back.volume == pytest.approx(truth.damage.volume, rel=0.01)
    assert iou(read(out / "scan_frame/damage/site-1.ply"), truth.deformed) > 0.97


@pytest.mark.slow
def test_what_is_left_has_the_skin_of_the_part_as_designed(bent: tuple[Result, Path]) -> None:
    result, out = bent
    left = read(out / "nominal_frame/undamaged.ply")
    lost = read(out / "nominal_frame/damage.ply")
    assert left.volume + lost.volume == pytest.approx(SIZE.prod(), rel=2e-4)
    far = left.triangles[np.linalg.norm(left.triangles.mean(axis=1) - BALL["centre"], axis=1) > 10].mean(axis=1)
    assert measure_off_box(far).max() < TOLERANCE / 10
    assert measure_off_box(read(out / "undamaged.ply").vertices).max() > 2 * TOLERANCE, "the adapted part is bent"
    scan = trimesh.load(out / "nominal_frame/scan.ply", process=False).vertices
    assert np.median(measure_off_box(scan[result.deviation.label == 0])) < TOLERANCE / 4


@pytest.mark.slow
def test_result_json_says_the_amount_and_which_frame_each_file_is_in(bent: tuple[Result, Path]) -> None:
    result, out = bent
    said = json.loads((out / "result.json").read_text())
    assert said["adapt"]["amount"] == pytest.approx(1.0, rel=0.5)
    assert result.sites[0].uncertainty is not None
    assert result.sites[0].uncertainty.adapt > 0
    (site,) = said["sites"]
    assert site["files"]["damage"] == "damage/site-1.ply"
    assert {"nominal_frame/damage/site-1.ply", "scan_frame/damage/site-1.ply"} <= set(site["files"]["every"])
    assert {f"nominal_frame/{name}" for name in ("undamaged.ply", "scan.ply")} <= set(said["export"]["files"])


@pytest.mark.slow
def test_damage_is_moved_back_by_the_inverse_of_the_field(drawn: tuple[Result, Result], tmp_path: Path) -> None:
    plain, there = drawn
    write(there, tmp_path, format=["ply"], frame="nominal")
    for site, bent in zip(plain.sites, there.sites, strict=True):
        back = read(tmp_path / f"nominal_frame/damage/site-{site.id}.ply")
        assert iou(back, site.damage) > 0.97
        assert iou(bent.damage, site.damage) < 0.95, "the bend matters"
        assert back.volume == pytest.approx(site.damage.volume, rel=0.01)


@pytest.mark.slow
def test_nominal_alone_writes_no_other_frame(drawn: tuple[Result, Result], tmp_path: Path) -> None:
    written = write(drawn[1], tmp_path, format=["stl", "3mf"], frame="nominal")
    assert {name.split("/")[0] for name in written.files} == {"nominal_frame", "truth"}
    assert {"nominal_frame/result.3mf", "nominal_frame/damage/site-1.stl"} <= set(written.files)


def test_a_part_as_designed_has_the_same_files(drawn: tuple[Result, Result], tmp_path: Path) -> None:
    rigid = replace(drawn[1], adapted=None)
    for frame in ("part", "nominal"):
        write(rigid, tmp_path / frame, format=["ply"], frame=frame)
    for name in ("damage/site-1.ply", "undamaged.ply", "scan.ply", "surface/site-1.ply"):
        before, after = tmp_path / "part" / name, tmp_path / "nominal/nominal_frame" / name
        assert before.read_bytes() == after.read_bytes(), name


def test_without_a_field_the_message_says_what_to_do(drawn: tuple[Result, Result], tmp_path: Path) -> None:
    assert drawn[1].adapted is not None
    blind = replace(drawn[1], adapted=replace(drawn[1].adapted, field=None))
    with pytest.raises(StageError, match="no displacement field") as told:
        write(blind, tmp_path, frame="nominal")
    assert "frame: part" in told.value.remedy


@pytest.mark.slow
def test_a_field_that_folds_is_refused(drawn: tuple[Result, Result], tmp_path: Path) -> None:
    adapted = drawn[1].adapted
    assert adapted is not None
    assert adapted.field is not None
    wild = replace(adapted.field, controls=adapted.field.controls * 40)
    with pytest.raises(StageError, match="folds"):
        write(replace(drawn[1], adapted=replace(adapted, field=wild)), tmp_path, frame="nominal")
