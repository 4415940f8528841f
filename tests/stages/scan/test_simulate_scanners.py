"""The virtual scanner at known positions: what it sees, and the errors that it makes."""

from __future__ import annotations

from typing import Any

import igl
import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from pydantic import ValidationError

from damageest.artefacts import Floats, Mesh, Part, Scan
from damageest.errors import StageError
from damageest.geometry.make_part import make_part
from damageest.geometry.rays import RayCaster
from damageest.geometry.sampling import sample_by_area
from damageest.stages.scan._views import find_visible
from damageest.stages.scan.simulate import Simulate

ABOVE = (0.0, 0.0, 300.0)


@pytest.fixture(scope="module")
def cuboid() -> Part:
    """70 x 50 x 30 about the origin."""
    return PARTS["cuboid"]()


@pytest.fixture(scope="module")
def ball() -> Part:
    """Radius 10 about the origin."""
    sphere = trimesh.creation.icosphere(subdivisions=5, radius=10.0)
    return make_part(np.asarray(sphere.vertices), np.asarray(sphere.faces))


@pytest.fixture(scope="module")
def step() -> Part:
    """A plate of 60 x 40 x 4 below z = 0 with a block of 20 x 20 x 20 on its middle."""
    plate = trimesh.creation.box((60, 40, 4)).apply_translation((0, 0, -2))
    block = trimesh.creation.box((20, 20, 22)).apply_translation((0, 0, 9))
    joined = trimesh.boolean.union([plate, block], engine="manifold")
    return make_part(np.asarray(joined.vertices), np.asarray(joined.faces))


def simulate(part: Part, **options: Any) -> Scan:
    return Simulate(**{"points": 20_000, "noise": 0, **options}).run("mm", part)


def distance(points: Floats, mesh: Mesh) -> Floats:
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    return np.asarray(np.sqrt(igl.point_mesh_squared_distance(np.array(points), vertices, faces)[0]))


def test_from_far_away_half_of_a_sphere_is_seen(ball: Part) -> None:
    points, face = sample_by_area(ball, 100_000, np.random.default_rng(0))
    seen = find_visible(RayCaster(ball), np.array([0, 0, 1e4]), points, face, 1e-5 * ball.diagonal)
    assert seen.mean() == pytest.approx(0.5, abs=0.01)


def test_density_falls_with_the_cosine_of_incidence(ball: Part) -> None:
    """On a sphere seen from far away, evenly spaced rays make the square of the cosine even between 0 and 1."""
    points = simulate(ball, scanners=[(0, 0, 1e4)], max_incidence=90, points=50_000).points
    share = (points[:, 2] / 10) ** 2
    assert points[:, 2].min() > -0.1
    assert np.quantile(share, [0.25, 0.5, 0.75]) == pytest.approx([0.25, 0.5, 0.75], abs=0.01)
    assert np.linalg.norm(points, axis=1).max() < 10 + 1e-9


def test_density_falls_with_the_squared_distance(cuboid: Part) -> None:
    """Above the middle of the top at height h, the share of points within radius r is that of their solid angle."""
    points = simulate(cuboid, scanners=[(0, 0, 35)], max_incidence=90, points=50_000).points
    radius = np.hypot(points[:, 0], points[:, 1])
    assert points[:, 2].min() == pytest.approx(15)
    cones = [1 - 20 / np.hypot(20, r) for r in (10, 24)]
    assert (radius < 10).sum() / (radius < 24).sum() == pytest.approx(cones[0] / cones[1], rel=0.02)


def test_incidence_is_limited(ball: Part) -> None:
    points = simulate(ball, scanners=[(0, 0, 1e4)], max_incidence=60).points
    assert points[:, 2].min() == pytest.approx(5, abs=0.3)


def test_from_above_only_the_top_of_a_box_is_seen(cuboid: Part) -> None:
    scan = simulate(cuboid, scanners=[ABOVE])
    assert np.abs(scan.points[:, 2] - 15).max() < 1e-9
    assert scan.viewpoints is not None
    assert scan.view is not None
    assert np.array_equal(scan.viewpoints, [ABOVE])
    assert (scan.view == 0).all()


def test_a_block_hides_the_plate_behind_it(step: Part) -> None:
    """The scanner at x = 100, z = 40 sees the block's side x = 10 and top z = 20; the shadow on the plate begins at
    the block and ends where the ray over the edge (-10, 20) meets z = 0: beyond the plate's end at x = -30."""
    scan = simulate(step, scanners=[(100, 0, 40)], max_incidence=89)
    plate = scan.points[np.abs(scan.points[:, 2]) < 1e-6]
    shaded = (np.abs(plate[:, 1]) < 8) & (plate[:, 0] < 9.9)
    assert not shaded.any()
    assert (plate[:, 0] > 12).sum() > 1000
    assert distance(scan.points, step).max() < 1e-4


def test_points_of_the_damaged_part_are_hidden_by_what_is_left(cuboid: Part) -> None:
    """A slot of 4 mm width and 20 mm depth: from a slant of 45 degrees only 4 mm of its wall are seen."""
    slot = {"tool": "box", "centre": (0, 0, 15), "size": (4, 60, 40)}
    scan = simulate(cuboid, damage=[slot], scanners=[(2000, 0, 2015)], points=50_000)
    wall = scan.points[np.abs(scan.points[:, 0] + 2) < 1e-6]
    assert len(wall) > 500
    assert wall[:, 2].min() == pytest.approx(11, abs=0.1)
    assert not (scan.points[:, 2] < -4).any() or scan.points[scan.points[:, 2] < -4][:, 0].min() > 34.9


def test_scanners_are_spread_around_the_part(cuboid: Part) -> None:
    scan = simulate(cuboid, scanners=20)
    assert scan.viewpoints is not None
    assert scan.view is not None
    away = np.linalg.norm(scan.viewpoints - cuboid.bounds.mean(axis=0), axis=1)
    assert away == pytest.approx(3 * cuboid.diagonal)
    assert np.abs(scan.viewpoints.mean(axis=0)).max() < 0.1 * away[0]
    assert set(scan.view) == set(range(20))
    sides = [
        np.abs(scan.points[:, axis] - sign * cuboid.bounds[1, axis]) < 1e-9 for axis in range(3) for sign in (1, -1)
    ]
    assert min(side.sum() for side in sides) > 500
    assert np.array_equal(scan.points, simulate(cuboid, scanners=20).points)
    assert not np.array_equal(scan.viewpoints, simulate(cuboid, scanners=20, seed=1).viewpoints)


def test_viewpoints_move_with_the_pose(cuboid: Part) -> None:
    scan = simulate(cuboid, scanners=[ABOVE, (300, 0, 0)], pose="random", outliers=0.01)
    assert scan.truth is not None
    back = scan.move(scan.truth.T_part_scan)
    assert np.allclose(back.viewpoints, [ABOVE, (300, 0, 0)])
    assert len(scan.points) == 20_000
    near = distance(back.points, cuboid) < 1e-6
    assert back.view is not None
    assert (back.points[near & (back.view == 0)][:, 2] > 14.99).all()
    assert (back.points[near & (back.view == 1)][:, 0] > 34.99).all()


def test_positions_may_be_unknown(cuboid: Part) -> None:
    known, unknown = (simulate(cuboid, scanners=3, positions_known=known) for known in (True, False))
    assert unknown.viewpoints is None
    assert unknown.view is None
    assert np.array_equal(known.points, unknown.points)


def test_a_scanner_that_sees_nothing(cuboid: Part) -> None:
    with pytest.raises(StageError, match="sees nothing"):
        simulate(cuboid, scanners=[(0, 0, 0)])
    scan = simulate(cuboid, scanners=[(0, 0, 0), ABOVE])
    assert "no points from scanner 1" in scan.notes
    assert np.array_equal(scan.viewpoints, [ABOVE])
    assert scan.view is not None
    assert not scan.view.any()


def test_depth_steps_along_the_ray(cuboid: Part) -> None:
    scan = simulate(cuboid, scanners=[ABOVE], depth_step=0.5, noise=0.1)
    depth = np.linalg.norm(scan.points - ABOVE, axis=1) / 0.5
    assert np.abs(depth - np.round(depth)).max() < 1e-9
    flat = simulate(cuboid, depth_step=0.5, noise=0.1).points
    assert np.abs(2 * flat[:, 2] - np.round(2 * flat[:, 2])).max() < 1e-9
    assert np.abs(2 * flat[:, 0] - np.round(2 * flat[:, 0])).max() > 0.1


def test_mixed_pixels_are_between_foreground_and_background(step: Part, cuboid: Part) -> None:
    scan = simulate(step, scanners=[(0, 0, 200)], mixed=0.02)
    off = distance(scan.points, step) > 1e-3
    assert off.mean() == pytest.approx(0.02, abs=0.004)
    mixed = scan.points[off]
    assert (mixed[:, 2] > 0).all()
    assert (mixed[:, 2] < 20).all()
    assert np.abs(mixed[:, :2]).max(axis=1) == pytest.approx(10.5, abs=1.5)
    assert any("no mixed pixels" in note for note in simulate(cuboid, scanners=[ABOVE], mixed=0.02).notes)


def test_waviness_is_smooth_and_has_its_standard_deviation(cuboid: Part) -> None:
    scan = simulate(cuboid, scanners=[(0, 0, 3000)], waviness=0.2, wavelength=10, points=50_000)
    height = scan.points[:, 2] - 15
    assert height.std() == pytest.approx(0.2, rel=0.2)
    from scipy.spatial import KDTree

    near = KDTree(scan.points[:, :2]).query(scan.points[:, :2], 2)[1][:, 1]
    assert np.abs(height - height[near]).mean() < 0.03
    along_normals = simulate(cuboid, waviness=0.2)
    assert distance(along_normals.points, cuboid).mean() > 0.1


def test_each_view_after_the_first_is_misplaced(cuboid: Part) -> None:
    places = [(0, 0, 300), (0, 0, -300)]
    right, wrong = (simulate(cuboid, scanners=places, misplaced=by).move(np.eye(4)) for by in (0, 0.5))
    assert right.view is not None
    assert right.viewpoints is not None
    assert wrong.viewpoints is not None
    moved = np.linalg.norm(wrong.points - right.points, axis=1)
    assert not moved[right.view == 0].any()
    assert 0.1 < moved[right.view == 1].mean() < 1.1
    assert np.array_equal(wrong.viewpoints[0], places[0])
    assert not np.array_equal(wrong.viewpoints[1], places[1])


def test_a_wrong_scale(cuboid: Part) -> None:
    right, wrong = (simulate(cuboid, scanners=[ABOVE], scale=scale) for scale in (1, 1.01))
    assert np.allclose(wrong.points, 1.01 * right.points)
    assert np.allclose(wrong.viewpoints, 1.01 * np.array([ABOVE]))


def test_added_metal_is_scanned_and_stated(cuboid: Part) -> None:
    bead = {"tool": "box", "centre": (0, 0, 16), "size": (10, 10, 4)}
    pit = {"tool": "box", "centre": (20, 0, 15), "size": (6, 6, 4)}
    scan = simulate(cuboid, damage=[pit], added=[bead], scanners=[ABOVE])
    assert scan.truth is not None
    assert scan.truth.damage is not None
    assert scan.truth.added is not None
    assert scan.truth.added.volume == pytest.approx(10 * 10 * 3)
    assert scan.truth.damage.volume == pytest.approx(6 * 6 * 2)
    top = scan.points[scan.points[:, 2] > 15 + 1e-6]
    assert np.abs(top[:, :2]).max() <= 5 + 1e-9
    assert top[:, 2] == pytest.approx(18)
    with pytest.raises(StageError, match="adds nothing"):
        simulate(cuboid, added=[{"tool": "sphere", "centre": (0, 0, 0), "radius": 5}])


def test_a_displaced_piece_is_missing_where_it_was_and_added_where_it_is(cuboid: Part) -> None:
    corner = {"tool": "box", "centre": (35, 25, 15), "size": (20, 20, 20)}
    scan = simulate(cuboid, detached=[{"piece": corner, "shift": (2, 0, 0)}])
    assert scan.truth is not None
    assert scan.truth.damage is not None
    assert scan.truth.added is not None
    assert scan.truth.damage.volume == pytest.approx(2 * 10 * 10)
    assert scan.truth.added.volume == pytest.approx(2 * 10 * 10)
    assert scan.points[:, 0].max() == pytest.approx(37, abs=1e-9)
    turned = simulate(cuboid, detached=[{"piece": corner, "rotation": (0, 0, 5)}]).truth
    assert turned is not None
    assert turned.added is not None
    with pytest.raises(StageError, match=r"detached piece 1 .* misses the part"):
        simulate(cuboid, detached=[{"piece": {**corner, "centre": (90, 0, 0)}, "shift": (1, 0, 0)}])


def test_the_table_has_points_on_its_upper_side_only(cuboid: Part) -> None:
    for options in ({}, {"scanners": [(0, 0, 500), (500, 0, 200)]}):
        scan = simulate(cuboid, table={"margin": 0.3}, **options)
        table = scan.points[scan.points[:, 2] < -15 + 1e-6]
        assert table[:, 2] == pytest.approx(-15)
        reach = np.hypot(35, 25) + 0.3 * cuboid.diagonal
        assert reach - 1.5 < np.linalg.norm(table[:, :2], axis=1).max() < reach + 1e-6
        inside = (np.abs(table[:, 0]) < 34.9) & (np.abs(table[:, 1]) < 24.9)
        assert not inside.any()


def test_surroundings_are_scanned_and_hide_the_part(cuboid: Part) -> None:
    clamp = {"tool": "box", "centre": (0, 0, 30), "size": (20, 20, 4)}
    scan = simulate(cuboid, surroundings=[clamp], scanners=[(0, 0, 3000)])
    assert scan.truth is not None
    assert scan.truth.damage is None
    assert scan.truth.added is None
    on_clamp = scan.points[:, 2] > 30
    assert on_clamp.mean() == pytest.approx(400 / 3500, abs=0.01)
    assert np.abs(scan.points[~on_clamp][:, :2]).max(axis=1).min() > 9.9


@pytest.mark.parametrize("options", [{"mixed": 0.1}, {"misplaced": 0.1}, {"misplaced": 0.1, "scanners": 1}])
def test_errors_of_views_need_scanners(options: dict[str, Any]) -> None:
    with pytest.raises(ValidationError, match="scanners"):
        Simulate(**options)


def test_unseen_regions_and_uneven_density_apply_to_scanners_too(cuboid: Part) -> None:
    hidden = [{"direction": (1, 0, 0), "beyond": (10, 0, 0)}]
    points = simulate(cuboid, scanners=[ABOVE], unseen=hidden, density=0.5).points
    assert points[:, 0].max() <= 10
    assert len(points) == 20_000
