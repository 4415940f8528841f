"""Files on the part as designed, where the part was adapted to its scan."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import Floats, Solid
from damageest.errors import StageError
from damageest.geometry.solids import iou
from damageest.io.meshes import read_mesh
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.export import ExportedFiles
from damageest.stages.export.files import Files

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


def read(path: Path) -> Solid:
    return Solid(*read_mesh(path)[:2])


def measure_off_box(points: Floats) -> Floats:
    """(N,) distance to the skin of the part as designed."""
    over = np.abs(points) - SIZE / 2
    outside = np.linalg.norm(np.maximum(over, 0), axis=1)
    return np.asarray(np.where(outside > 0, outside, -over.max(axis=1)))


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


def test_result_json_says_which_frame_each_file_is_in(bent: tuple[Result, Path]) -> None:
    _, out = bent
    said = json.loads((out / "result.json").read_text())
    (site,) = said["sites"]
    assert site["files"]["damage"] == "damage/site-1.ply"
    assert {"nominal_frame/damage/site-1.ply", "scan_frame/damage/site-1.ply"} <= set(site["files"]["every"])
    assert {f"nominal_frame/{name}" for name in ("undamaged.ply", "scan.ply")} <= set(said["export"]["files"])


def test_nominal_alone_writes_no_other_frame(bent: tuple[Result, Path], tmp_path: Path) -> None:
    written = write(bent[0], tmp_path, format=["stl", "3mf"], frame="nominal")
    assert {name.split("/")[0] for name in written.files} == {"nominal_frame", "truth"}
    assert {"nominal_frame/result.3mf", "nominal_frame/damage/site-1.stl"} <= set(written.files)


def test_a_part_as_designed_has_the_same_files(bent: tuple[Result, Path], tmp_path: Path) -> None:
    rigid = replace(bent[0], adapted=None)
    for frame in ("part", "nominal"):
        write(rigid, tmp_path / frame, format=["ply"], frame=frame)
    for name in ("damage/site-1.ply", "undamaged.ply", "scan.ply", "surface/site-1.ply"):
        before, after = tmp_path / "part" / name, tmp_path / "nominal/nominal_frame" / name
        assert before.read_bytes() == after.read_bytes(), name


def test_without_a_field_the_message_says_what_to_do(bent: tuple[Result, Path], tmp_path: Path) -> None:
    assert bent[0].adapted is not None
    blind = replace(bent[0], adapted=replace(bent[0].adapted, field=None))
    with pytest.raises(StageError, match="no field") as told:
        write(blind, tmp_path, frame="nominal")
    assert "frame: part" in told.value.remedy


def test_a_field_that_folds_is_refused(bent: tuple[Result, Path], tmp_path: Path) -> None:
    adapted = bent[0].adapted
    assert adapted is not None
    assert adapted.field is not None
    wild = replace(adapted.field, controls=adapted.field.controls * 40)
    with pytest.raises(StageError, match="folds"):
        write(replace(bent[0], adapted=replace(adapted, field=wild)), tmp_path, frame="nominal")
