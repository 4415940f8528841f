"""A repaired site is judged place by place, by every point on its finished skin."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Floats, Mesh, Solid
from damageest.geometry.distance import signed_distance
from damageest.geometry.solids import to_arrays
from damageest.inspection.discrepancies import Finding
from damageest.inspection.places import Places, cut_places, land_points
from damageest.inspection.verdicts import Verdict, judge_site, judge_whole

TOLERANCE, DEFECT, NOISE = 0.2, 3.0, 0.03
LOW, HIGH = (-10.0, -10.0, -5.0), (10.0, 10.0, 5.0)


def make_solid(body: Manifold) -> Solid:
    return Solid(*to_arrays(body))


BLOCK = make_solid(Manifold.cube((20, 20, 10), True))
DEPOSIT = make_solid(Manifold.cube((14, 12, 4), True).translate((0, 2, 5)))
"""Stock of 2 over the top, as far as z = 7; 14 x 12 of skin, and 0.1 around that."""
SKIN = 14.2 * 12.2


@pytest.fixture(scope="module")
def places() -> Places:
    found = cut_places(BLOCK, DEPOSIT, 0.1, DEFECT)
    assert found is not None
    return found


def scan_top(spacing: float, shift: float = 0.0) -> Floats:
    """Points on the top of the block in a jittered grid, or as high above it as ``shift``."""
    rng = np.random.default_rng(1)
    x, y = (axis.ravel() for axis in np.meshgrid(*[np.arange(-9.9, 9.9, spacing)] * 2))
    x, y = x + 0.2 * spacing * rng.normal(size=len(x)), y + 0.2 * spacing * rng.normal(size=len(y))
    return np.stack([x, y, 5 + shift + NOISE * rng.normal(size=len(x))], axis=1)


def judge(places: Places, points: Floats, *findings: Finding) -> Verdict:
    landed = land_points(places, BLOCK, points, signed_distance(points, BLOCK)[0])
    return judge_site(1, places, landed, findings, TOLERANCE, NOISE, "mm")


def in_disc(points: Floats, x: float, y: float, radius: float) -> Floats:
    return np.asarray(np.hypot(points[:, 0] - x, points[:, 1] - y) < radius)


def test_places_cover_the_skin_evenly(places: Places) -> None:
    assert len(places.skin.at) * places.skin.area == pytest.approx(SKIN, rel=0.02)
    area = np.bincount(places.of) * places.skin.area
    assert area.sum() == pytest.approx(SKIN, rel=0.02)
    assert area.max() < 1.1 * DEFECT**2
    assert np.allclose(places.skin.at[:, 2], 5)


def test_skin_of_large_triangles_is_cut_where_the_site_is() -> None:
    plate = make_solid(Manifold.cube((4000, 4000, 10), True))
    found = cut_places(plate, DEPOSIT, 0.1, DEFECT)
    assert found is not None
    assert len(found.skin.at) * found.skin.area == pytest.approx(SKIN, rel=0.05)


@pytest.mark.parametrize("spacing", [0.3, 0.6, 1.0])
def test_a_perfect_site_is_met(places: Places, spacing: float) -> None:
    verdict = judge(places, scan_top(spacing))
    assert verdict.outcome == "met", verdict
    assert verdict.seen >= 0.98
    assert verdict.lowest is not None
    assert verdict.highest is not None
    assert max(-verdict.lowest, verdict.highest) < 2 * NOISE
    assert verdict.shows is not None
    assert verdict.shows < 4 * spacing


@pytest.mark.parametrize("shift", [-0.5, 0.5, -0.3])
def test_a_whole_skin_off_is_not_met_whatever_the_finding_covers(places: Places, shift: float) -> None:
    verdict = judge(places, scan_top(0.6, shift))
    assert verdict.outcome == "not met"
    end = verdict.lowest if shift < 0 else verdict.highest
    assert end == pytest.approx(shift, abs=2 * NOISE)


@pytest.mark.parametrize(("spacing", "radius"), [(0.3, 0.6), (0.6, 1.2), (1.0, 1.5)])
def test_a_local_pit_is_not_met(places: Places, spacing: float, radius: float) -> None:
    points = scan_top(spacing)
    points[in_disc(points, 2, 3, radius), 2] -= 0.5
    assert judge(places, points).outcome == "not met"


def test_a_spot_without_points_is_not_shown(places: Places) -> None:
    points = scan_top(0.4)
    verdict = judge(places, points[~in_disc(points, 2, 3, 2.6)])
    assert verdict.outcome == "not shown"
    assert verdict.shows is not None
    assert verdict.shows > 4


def test_a_sparse_scan_is_not_shown_however_often_each_point_is_told(places: Places) -> None:
    sparse = scan_top(2.6)
    for points in (sparse, np.repeat(sparse, 5, axis=0)):
        verdict = judge(places, points)
        assert verdict.outcome == "not shown"
        assert verdict.seen < 0.9


def test_the_other_side_of_a_thin_wall_is_another_place() -> None:
    wall = make_solid(Manifold.cube((20, 20, 0.5), True))
    found = cut_places(wall, make_solid(Manifold.cube((10, 10, 2), True).translate((0, 0, 1.2))), 0.1, DEFECT)
    assert found is not None
    points = scan_top(0.5, -5.25)
    landed = land_points(found, wall, points, -points[:, 2] - 0.25)
    assert not len(landed.index)


def test_a_finding_elsewhere_decides_on_the_part_unless_the_job_says_so() -> None:
    met = Verdict(1, "met", "", 1.0, 0.0, 0.0, 1.0)
    wear = Finding("missing", 0, 12.0, None, None, 0.5, (0.0, 0.0, 0.0), "proven", (0,))
    assert judge_whole([met], [wear], "decides", "mm").outcome == "not met"
    assert judge_whole([met], [wear], "listed", "mm").outcome == "met"
    assert judge_whole([met], [], "decides", "mm").outcome == "met"


def test_skin_without_a_place_is_not_shown() -> None:
    away = make_solid(Manifold.cube((1, 1, 1), True))
    assert cut_places(BLOCK, away, 0.1, DEFECT) is None
    assert judge_site(1, None, None, [], TOLERANCE, NOISE, "mm").outcome == "not shown"


def test_a_mesh_of_needles_has_the_same_places() -> None:
    fan = Mesh(*to_arrays(Manifold.cylinder(10, 10, 10, 720).translate((0, 0, -5))))
    found = cut_places(fan, make_solid(Manifold.cylinder(4, 6, 6, 90).translate((0, 0, 3))), 0.1, DEFECT)
    assert found is not None
    assert len(found.skin.at) * found.skin.area == pytest.approx(np.pi * 6.1**2, rel=0.05)
