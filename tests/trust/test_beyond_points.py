"""A volume that its scan points do not show is found, and one that they show is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Floats, Scan
from damageest.geometry.distance import distance_to_mesh
from damageest.geometry.scan_field import ScanField
from damageest.trust.beyond_points import BeyondPoints, measure_beyond_points
from tests.sparse_scenes import GAP, as_part, as_solid, block, pad, pocket, scan

DEPTH, TOLERANCE = 0.35, 0.15


def ask(volume: Any, lost: Any, points: Floats | None = None) -> BeyondPoints:
    """Of a ``volume`` found, where ``lost`` is what is gone."""
    points = scan(block() - lost) if points is None else points
    own = points[distance_to_mesh(points, as_part(block())) > TOLERANCE]
    return measure_beyond_points(as_solid(block() ^ volume), make_field(points), own, "mm")


def make_field(points: Floats) -> ScanField:
    return ScanField.measure(as_part(block()), Scan(points, spacing=GAP), TOLERANCE)


@pytest.mark.parametrize(
    "lost",
    [
        pocket(DEPTH),
        Manifold.cube((30, 40, 4), True).rotate((0, 12, 0)).translate((14, 0, 5)),
        Manifold.sphere(3, 96).translate((0, 0, 4.5)),
        Manifold.cylinder(6, 1.5, 1.5, 64).translate((2, 2, -1)),
    ],
    ids=["pocket", "edge", "pit", "deep hole"],
)
def test_the_truth_is_shown(lost: Any) -> None:
    found = ask(lost, lost)
    assert not found.reason
    assert found.short < 0.01 * lost.volume()


def test_an_undercut_is_shown_by_the_points_on_it() -> None:
    keyhole = Manifold.cylinder(2, 1, 1, 64).translate((0, 0, 2.5)) + Manifold.sphere(2.8, 96)
    assert not ask(keyhole, keyhole, scan(block() - keyhole)).is_contradicted


def test_a_surface_below_its_points_is_contradicted() -> None:
    found = ask(pocket(2 * DEPTH), pocket(DEPTH))
    assert found.is_contradicted
    assert found.share == pytest.approx(0.45, abs=0.05)
    assert found.depth == pytest.approx(DEPTH, abs=0.02)


def test_the_place_where_it_bulges_is_told() -> None:
    """A pocket that came out right but for a bump in its floor, at x = 3."""
    bump = Manifold.sphere(1.5, 48).scale((1, 1, 0.8)).translate((3, 0, 4 - DEPTH))
    found = ask(pocket(DEPTH) + bump, pocket(DEPTH))
    assert found.reason
    assert found.at is not None
    assert found.at[:2] == pytest.approx((3, 0), abs=0.8)
    assert f"near ({found.at[0]:.4g}" in found.reason


def test_more_than_skin_times_depth_is_contradicted() -> None:
    points = scan(block() - pocket(DEPTH))
    found = ask(pocket(5.0), pocket(DEPTH), points)
    assert found.is_contradicted
    assert "exceeds lost skin times depth" in found.reason


def test_added_metal_is_asked_as_well() -> None:
    points = scan(block() + pad(DEPTH))
    own = points[points[:, 2] > 4 + TOLERANCE]
    field = make_field(points)
    assert not measure_beyond_points(as_solid(pad(DEPTH)), field, own, "mm").reason
    assert measure_beyond_points(as_solid(pad(4 * DEPTH)), field, own, "mm").is_contradicted


def test_a_thin_wall_that_came_out_thick_is_told() -> None:
    """Two pockets with a wall of 0.1 mm between them; what was found has a wall of 1.1 mm on one side of it."""
    one = Manifold.cube((10, 8, 3), True).translate((0, -4.05, 4))
    other = Manifold.cube((10, 8, 3), True).translate((0, 4.05, 4))
    thick = one + other.translate((0, 1, 0))
    kept = Manifold.cube((10, 1, 3), True).translate((0, 8.55, 4))
    found = ask(thick - kept, one + other)
    assert 0.5 < found.short / (10 * 1.0 * 1.5) < 1.1
    assert ask(one + other, one + other).short < 0.25 * (10 * 1.0 * 1.5)


def test_without_points_of_its_own_nothing_is_said() -> None:
    found = measure_beyond_points(as_solid(pad(1.0)), make_field(scan(block())), np.empty((0, 3)), "mm")
    assert not found.reason
