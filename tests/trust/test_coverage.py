"""What the scan shows of the skin, against skin that is known to be seen."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import Part, Scan
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate
from tests.damaged_box import SIZE, TRUE_VOLUME, box

TOP_ONLY = [[3.0, -2.0, 400.0]]
X, Y, Z = SIZE
AREA = 2 * (X * Y + X * Z + Y * Z)


def run(part: Part, scan: Scan, **job: object) -> Result:
    return damageest.run({"version": 1, "tolerance": 0.2, "align": "none", **job}, part=part, scan=scan)


def simulate(part: Part, **options: object) -> Scan:
    return Simulate.model_validate({"points": 6000, "noise": 0.04, **options}).run("mm", part)


@pytest.mark.slow
def test_one_view_shows_the_top_and_nothing_is_claimed_of_the_rest() -> None:
    result = run(box(), simulate(box(), scanners=TOP_ONLY))
    assert result.coverage
    assert result.coverage.seen == pytest.approx(X * Y / AREA, abs=0.02)
    (region,) = result.coverage.unseen
    assert region.area == pytest.approx(AREA - X * Y, rel=0.05)
    assert region.why == "hidden"
    assert 0.5 * X * Y * Z < region.volume < X * Y * Z
    assert (region.bounds[1] - region.bounds[0]).tolist() == pytest.approx([X, Y, Z], abs=0.5)
    assert not result.sites


@pytest.mark.slow
def test_without_a_scanner_position_the_reason_is_unknown() -> None:
    seen = simulate(box(), scanners=TOP_ONLY, positions_known=False)
    result = run(box(), seen)
    assert result.coverage
    assert [region.why for region in result.coverage.unseen] == ["unknown"]


@pytest.mark.slow
def test_a_full_scan_shows_all_and_damage_counts_as_seen() -> None:
    tool = {"tool": "sphere", "centre": [0, 0, Z / 2], "radius": 6}
    result = run(box(), simulate(box(), damage=[tool]))
    assert result.coverage
    assert result.coverage.seen > 0.995
    assert not result.coverage.unseen
    assert result.damage_volume == pytest.approx(TRUE_VOLUME, rel=0.03)


@pytest.mark.slow
def test_regions_name_the_cad_faces_and_cells_add_up() -> None:
    mesh = trimesh.creation.box(SIZE)
    numbers = np.abs(mesh.face_normals).argmax(axis=1)
    part = Part(mesh.vertices, mesh.faces, faces_brep=numbers, face_names=("x", "y", "z"))
    result = run(part, simulate(part, unseen=[{"direction": [1, 0, 0], "angle": 30}]))
    assert result.coverage
    (region,) = result.coverage.unseen
    assert region.faces == (0,)
    assert region.area == pytest.approx(Y * Z, rel=0.1)
    assert result.coverage.skin.area == pytest.approx(AREA)
    assert np.isnan(result.coverage.distance[~result.coverage.is_seen]).all()


def test_the_far_side_of_a_thin_wall_is_not_seen_through_it() -> None:
    mesh = trimesh.creation.box((40, 0.3, 20))
    wall = Part(mesh.vertices, mesh.faces)
    result = run(wall, simulate(wall, scanners=[[0, 300, 0]], noise=0.02), tolerance=0.08)
    assert result.coverage
    assert result.coverage.seen == pytest.approx(0.5, abs=0.03)
