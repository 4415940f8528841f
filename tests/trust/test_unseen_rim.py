"""The share of a rim beside skin that the scan does not show, on a box with a groove from end to end."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import Mesh, Part, Scan, Solid
from damageest.findings import Coverage, UnseenRegion
from damageest.stages.scan.simulate import Simulate
from damageest.trust.skin.unseen_rim import find_unseen_beside, measure_unseen_rim
from damageest.trust.terms.beside import limit_beside
from tests import damaged_box

LEAST = {"version": 1, "tolerance": 0.2, "align": "none"}


@cache
def scan_dent(kept: float) -> tuple[damageest.Result, Solid]:
    """A run on a box with a dent, without the points of its top beyond x = ``kept``; and the true damage."""
    part = damaged_box.box()
    tool = {"tool": "sphere", "centre": [0, 0, 13], "radius": 8}
    scan = Simulate.model_validate({"damage": [tool], "points": 10_000, "noise": 0.04}).run("mm", part)
    points = scan.points[(scan.points[:, 0] < kept) | (scan.points[:, 2] < 5)]
    assert scan.truth is not None
    assert scan.truth.damage is not None
    return damageest.run(LEAST, part=part, scan=Scan(points)), scan.truth.damage


def measure(result: damageest.Result, damage: Solid) -> float:
    assert result.coverage is not None
    return measure_unseen_rim(damage, result.part, result.coverage, 1.0)


@pytest.mark.slow
def test_a_rim_that_the_scan_shows_has_no_share() -> None:
    result, damage = scan_dent(100)
    assert measure(result, damage) == 0
    assert result.sites[0].verdict.level == "proven"


@pytest.mark.slow
@pytest.mark.parametrize(("kept", "share"), [pytest.param(0.0, 0.5, marks=pytest.mark.slow), (3.0, 0.38)])
def test_the_share_is_that_of_the_rim_in_the_unseen_skin(kept: float, share: float) -> None:
    result, damage = scan_dent(kept)
    assert measure(result, damage) == pytest.approx(share, abs=0.12)
    site = result.sites[0]
    assert site.verdict.level == "likely"
    assert site.volume_95 is not None
    assert site.volume_95[0] <= damage.volume < site.volume_95[1] == np.inf


@pytest.mark.slow
def test_a_solid_without_a_rim_has_no_share() -> None:
    result, _ = scan_dent(3.0)
    ball = trimesh.creation.icosphere(2, 2.0)
    assert measure(result, Solid(np.asarray(ball.vertices), np.asarray(ball.faces))) == 0
    assert isinstance(result.part, Part)


@cache
def make_pitted_plate() -> tuple[Mesh, Solid, np.ndarray]:
    """The cells of a plate of 0.8 mm, a pit 4 mm wide and 0.4 mm deep in its top, and which of the pit's faces are in
    the plate."""
    plate = trimesh.creation.box((20, 20, 0.8)).subdivide_to_size(1.0)
    pit = trimesh.creation.box((4, 4, 0.4))
    pit.apply_translation((0, 0, 0.2))
    damage = Solid(np.asarray(pit.vertices), np.asarray(pit.faces))
    return Mesh(np.asarray(plate.vertices), np.asarray(plate.faces)), damage, damage.face_normals[:, 2] < 0.9


@pytest.mark.parametrize(
    ("unseen", "count"),
    [("back", 0), ("top beside it", 1), ("top far away", 0), ("back and top beside it", 1)],
)
def test_the_other_side_of_a_thin_wall_is_not_beside_a_pit(unseen: str, count: int) -> None:
    skin, damage, inner = make_pitted_plate()
    centres, up = skin.triangles.mean(axis=1), skin.face_normals[:, 2]
    region = np.full(len(up), -1)
    if "top" in unseen:
        x = centres[:, 0]
        region[(up > 0.9) & ((x > 2) & (x < 3) if "beside" in unseen else x > 6)] = 1
    if "back" in unseen:
        region[up < -0.9] = 0
    areas = np.linalg.norm(skin.cross, axis=1) / 2
    regions = tuple(
        UnseenRegion(float(areas[region == k].sum()), np.zeros(3), np.zeros((2, 3)), (), 100.0, "no points")
        for k in (0, 1)
    )
    coverage = Coverage(0.5, regions, skin, region < 0, np.zeros(len(up)), np.zeros(len(up), bool), region)
    beside = find_unseen_beside(coverage, damage, inner, 1.2)
    assert set(region[beside]) <= {1}
    assert (len(beside) > 0) == bool(count)
    assert limit_beside(coverage, damage, inner, 1.2, 0.4) == pytest.approx(count * 0.4 * regions[1].area)
