"""Parts from scans of undamaged specimens of known shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from damageest_evaluate.scores import iou

import damageest
from damageest.artefacts import Part
from damageest.errors import InputError
from damageest.stages.part.reconstruct import PartFromScan
from damageest.stages.scan.simulate import Simulate
from tests.damaged_box import TRUE_VOLUME, box, scan


def specimen(folder: Path, points: int = 25_000, **options: object) -> Path:
    path = folder / "specimen.npy"
    np.save(path, Simulate.model_validate({"points": points, "noise": 0.03, **options}).run("mm", box()).points)
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return specimen(tmp_path_factory.mktemp("whole"))


@pytest.fixture(scope="module")
def part(whole: Path) -> Part:
    return PartFromScan(path=whole).run("mm")


def test_the_box_comes_back_closed_with_a_note_of_its_errors(part: Part) -> None:
    assert isinstance(part, Part)
    assert iou([part], [box()]) > 0.98
    assert 0.03 < part.tessellation_error < 0.3
    assert "25000 scan points" in part.notes[-1]
    assert "rounded" in part.notes[-1]


@pytest.mark.slow
def test_same_scan_same_bytes(part: Part, whole: Path) -> None:
    again = PartFromScan(path=whole).run("mm")
    assert again.vertices.tobytes() == part.vertices.tobytes()


def test_an_opening_is_refused_with_its_place(tmp_path: Path) -> None:
    path = specimen(tmp_path, unseen=[{"direction": [0, 0, -1], "angle": 40}])
    with pytest.raises(InputError, match="opening"):
        PartFromScan(path=path).run("mm")


def open_top(whole: Path, path: Path, radius: float) -> Path:
    """The specimen without its points that lie so near to a place of its top."""
    points = np.load(whole)
    np.save(path, points[np.linalg.norm(points - [5, 3, 10], axis=1) > radius])
    return path


@pytest.mark.slow
def test_a_small_opening_is_closed_and_noted(tmp_path: Path, whole: Path) -> None:
    part = PartFromScan(path=open_top(whole, tmp_path / "open.npy", 1.8)).run("mm")
    assert iou([part], [box()]) > 0.98
    assert "closes openings" in part.notes[-1]


@pytest.mark.slow
def test_a_larger_one_is_refused(tmp_path: Path, whole: Path) -> None:
    with pytest.raises(InputError, match="opening"):
        PartFromScan(path=open_top(whole, tmp_path / "open.npy", 4.0)).run("mm")


@pytest.mark.slow
def test_uneven_density_is_no_opening(tmp_path: Path) -> None:
    part = PartFromScan(path=specimen(tmp_path, 30_000, density=0.7)).run("mm")
    assert iou([part], [box()]) > 0.98
    assert not [note for note in part.notes if "openings" in note]


@pytest.mark.slow
def test_walls_thinner_than_the_scan_resolves_are_refused(tmp_path: Path) -> None:
    sheet = trimesh.creation.box((40, 30, 0.6))
    scanner = Simulate.model_validate({"points": 8000, "noise": 0.03})
    np.save(tmp_path / "sheet.npy", scanner.run("mm", Part(sheet.vertices, sheet.faces)).points)
    with pytest.raises(InputError, match="thinner walls"):
        PartFromScan(path=tmp_path / "sheet.npy").run("mm")


def test_too_few_points_and_too_fine_a_cell_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="too few"):
        PartFromScan(path=specimen(tmp_path, 500)).run("mm")
    with pytest.raises(InputError, match="most_cells"):
        PartFromScan(path=specimen(tmp_path), cell=0.02).run("mm")


@pytest.mark.slow
def test_a_job_without_cad_finds_the_damage(tmp_path: Path) -> None:
    specimen(tmp_path, 8000)
    np.save(tmp_path / "scan.npy", scan(6000))
    part = {"use": "reconstruct", "path": str(tmp_path / "specimen.npy")}
    job = {"version": 1, "tolerance": 0.4, "align": "none", "part": part, "scan": str(tmp_path / "scan.npy")}
    assert damageest.run(job).damage_volume == pytest.approx(TRUE_VOLUME, rel=0.05)
