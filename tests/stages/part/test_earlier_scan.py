"""Two scans of one part: what was lost between them, where both see the skin, and nothing where only one does."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.differences import BALL, EARLY, LATE, DrawnPair, Pair, draw_pair

import damageest
from damageest.artefacts import Floats
from damageest.errors import DamageestError, InputError
from damageest.result import Result
from damageest.stages.part.earlier_scan import EarlierScan

CHIP = (BALL, 5, (20, 15, 10))
USUAL: dict[str, Any] = {"before": EARLY, "after": LATE, "first": (20_000, 0.03), "second": (16_000, 0.04)}
FEW = USUAL | {"first": (8000, 0.03), "second": (6000, 0.04)}


def compare(folder: Path, drawn: DrawnPair, before: Floats | None = None, **job: Any) -> Result:
    np.save(folder / "before.npy", drawn.before if before is None else before)
    np.save(folder / "after.npy", drawn.after)
    part = {"use": "earlier_scan", "path": str(folder / "before.npy")}
    return damageest.run({"version": 1, "part": part, "scan": str(folder / "after.npy"), **job})


@pytest.mark.slow
def test_a_chip_between_two_partial_scans_in_other_poses_has_its_volume(tmp_path: Path) -> None:
    drawn = draw_pair(Pair("", "block", CHIP, **USUAL), 1)
    result = compare(tmp_path, drawn)
    (site,) = result.sites
    low, high = site.volume_95 or (0.0, 0.0)
    assert site.accepted
    assert low <= drawn.lost <= high
    assert high - low < 0.5 * drawn.lost
    told = next(note for note in result.warnings if note.code == "earlier_scan")
    assert 0.2 < (told.amount or 0) < 0.5  # what the later scan alone sees
    assert result.coverage is not None
    assert "earlier scan" in {region.why for region in result.coverage.unseen}
    assert result.coverage.seen > 0.85  # of the skin that the earlier scan shows


@pytest.mark.slow
def test_where_nothing_changed_nothing_is_found(tmp_path: Path) -> None:
    result = compare(tmp_path, draw_pair(Pair("", "bracket", **USUAL), 2))
    assert result.status == "ok"
    assert not [site for site in result.sites if site.accepted]
    assert result.damage_volume == 0
    assert result.volume_95 is not None
    assert result.volume_95[0] == 0


@pytest.mark.slow
def test_a_later_scan_in_another_unit_is_refused(tmp_path: Path) -> None:
    drawn = draw_pair(Pair("", "block", CHIP, scale=1 / 25.4, **FEW), 1)
    with pytest.raises(InputError, match="in inches"):
        compare(tmp_path, drawn)


@pytest.mark.slow
def test_an_open_scan_has_to_tell_which_side_is_metal(tmp_path: Path) -> None:
    drawn = draw_pair(Pair("", "block", **FEW), 1)
    with pytest.raises(InputError, match="does not tell which side of its surface is metal"):
        compare(tmp_path, drawn, drawn.before[:, :3])
    turned = drawn.before.copy()
    turned[::2, 3:] *= -1
    with pytest.raises(InputError, match="point to both sides"):
        compare(tmp_path, drawn, turned)


@pytest.mark.slow
def test_an_open_mesh_is_skin_where_it_has_triangles(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(5, 10.0)
    seen = ball.triangles_center[:, 2] > -5
    trimesh.Trimesh(ball.vertices, ball.faces[seen]).export(tmp_path / "before.stl")
    part = EarlierScan(path=tmp_path / "before.stl").run("mm")
    assert part.unseen is not None
    centres = part.triangles.mean(axis=1)
    areas = np.linalg.norm(part.cross, axis=1) / 2
    assert np.abs(np.linalg.norm(centres[~part.unseen], axis=1) - 10).max() < 0.1
    assert part.unseen[centres[:, 2] < -5.5].all()
    assert areas[~part.unseen].sum() == pytest.approx(2 * np.pi * 10 * 15, rel=0.15)


def test_too_few_points_are_refused(tmp_path: Path) -> None:
    drawn = draw_pair(Pair("", "block", **FEW), 1)
    with pytest.raises(DamageestError, match="too few"):
        compare(tmp_path, drawn, drawn.before[:500])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_given_scanner_position_tells_where_the_metal_is(side: float, tmp_path: Path) -> None:
    x, y = np.random.default_rng(4).uniform(-20, 20, (2, 2500))
    np.save(tmp_path / "plate.npy", np.column_stack([x, y, 0.01 * x * y]))  # a saddle: no side of it is round
    found = EarlierScan(path=tmp_path / "plate.npy", viewpoint=(0.0, 0.0, 300 * side), cell=1.5).run(unit="mm")
    x, y, z = found.vertices.mean(axis=0)
    assert side * z < 0  # the metal is beyond the skin
    with pytest.raises(ValueError, match="viewpoint"):
        EarlierScan(path=(tmp_path / "plate.npy",), viewpoint=(0.0, 0.0, 300.0))
