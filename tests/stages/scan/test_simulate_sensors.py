"""The errors that the virtual scanner makes as real sensors do: each has the size and the form that its option says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from pydantic import ValidationError

from damageest.artefacts import Floats, Part, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.make_part import make_part
from damageest.stages.scan.simulate import Simulate


@pytest.fixture(scope="module")
def cuboid() -> Part:
    """70 x 50 x 30 about the origin."""
    return PARTS["cuboid"]()


@pytest.fixture(scope="module")
def stairs() -> Part:
    """Two plates of 100 x 50: their tops are at z = 0 and z = 200, and lie beside each other."""
    low, high = trimesh.creation.box((100, 50, 10)), trimesh.creation.box((100, 50, 210))
    low.apply_translation((0, -25, -5))
    high.apply_translation((0, 25, 95))
    joined = trimesh.boolean.union([low, high], engine="manifold")
    return make_part(np.asarray(joined.vertices), np.asarray(joined.faces))


def simulate(part: Part, **options: Any) -> Scan:
    return Simulate(**{"points": 20_000, "noise": 0, **options}).run("mm", part)


def off(scan: Scan, part: Part) -> Floats:
    return signed_distance(scan.points, part)[0]


@pytest.mark.parametrize("power", [1.0, 2.0])
def test_noise_grows_with_a_power_of_the_distance(stairs: Part, power: float) -> None:
    """From z = 400 the tops are 400 and 200 away."""
    options = {"scanners": [(0, 0, 400)], "max_incidence": 30, "reference_distance": 400}
    scan = simulate(stairs, noise=1.0, noise_growth=power, noise_along="ray", **options)
    deep = scan.points[scan.points[:, 2] < 50][:, 2]
    high = scan.points[scan.points[:, 2] > 150][:, 2] - 200
    assert deep.std() == pytest.approx(1.0, rel=0.08)
    assert high.std() == pytest.approx(0.5**power, rel=0.08)


def test_without_a_reference_the_noise_holds_at_the_middle_of_the_part(cuboid: Part) -> None:
    scan = simulate(cuboid, noise=0.5, noise_growth=2, noise_along="ray", scanners=[(0, 0, 60)], max_incidence=10)
    assert off(scan, cuboid).std() == pytest.approx(0.5 * (45 / 60) ** 2, rel=0.05)


def test_noise_grows_with_incidence(cuboid: Part) -> None:
    """At 60 degrees the cosine is a half."""
    far = [(0, 5000 * np.sin(np.pi / 3), 5000 * np.cos(np.pi / 3))]
    scan = simulate(cuboid, noise=0.1, noise_slant=2, noise_along="ray", scanners=far)
    top = scan.points[(scan.points[:, 2] > 10) & (scan.points[:, 1] < 20)]
    along = (top[:, 2] - 15) / np.cos(np.pi / 3)
    assert along.std() == pytest.approx(0.4, rel=0.06)


def test_noise_along_the_ray_leaves_the_ray(cuboid: Part) -> None:
    place = np.array([0.0, 0.0, 300.0])
    exact, noisy = (simulate(cuboid, scanners=[place], noise=by, noise_along="ray") for by in (0, 0.5))
    ways = [scan.points - place for scan in (exact, noisy)]
    ways = [way / np.linalg.norm(way, axis=1, keepdims=True) for way in ways]
    assert np.abs(ways[0] - ways[1]).max() < 1e-12
    assert off(noisy, cuboid).std() == pytest.approx(0.5, rel=0.05)
    along_normal = simulate(cuboid, noise=0.5, noise_along="ray")
    assert off(along_normal, cuboid).std() == pytest.approx(0.5, rel=0.05)


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_depth_steps_grow_with_the_distance(stairs: Part, power: float) -> None:
    """The gap between neighbouring depths is the step there; the noise reaches all of them."""
    place = np.array([0.0, 0.0, 400.0])
    options = {"scanners": [place], "depth_step": 2.0, "depth_growth": power, "reference_distance": 400}
    scan = simulate(stairs, noise=8.0, noise_along="ray", max_incidence=30, **options)
    depth = np.unique(np.round(np.linalg.norm(scan.points - place, axis=1), 5))
    for low, high in ((195, 215), (395, 415)):
        own = depth[(depth > low) & (depth < high)]
        middle, gap = (own[1:] + own[:-1]) / 2, np.diff(own)
        assert len(gap) >= 8
        assert np.abs(gap / (2 * (middle / 400) ** power) - 1).max() < 0.01


def test_a_step_that_grows_is_one_of_disparity(cuboid: Part) -> None:
    """Step 1 at 100 and power 2: 1 / z is a multiple of 1 / 100²."""
    place = np.array([0.0, 0.0, 100.0])
    scan = simulate(cuboid, scanners=[place], depth_step=1.0, depth_growth=2)
    count = 1e4 / np.linalg.norm(scan.points - place, axis=1)
    assert np.abs(count - np.round(count)).max() < 1e-6


def test_laser_lines_are_a_gap_apart_and_dense(cuboid: Part) -> None:
    place = np.array([0.0, 0.0, 300.0])
    scan = simulate(cuboid, scanners=[place], stripes=3.0)
    assert np.abs(off(scan, cuboid)).max() < 1e-3
    top = scan.points[:, :2] * 300 / (300 - scan.points[:, 2:])  # seen from the scanner on the plane of the middle
    angle = np.radians(np.arange(0, 180, 0.01))
    lines = top[:300] @ np.array([np.cos(angle), np.sin(angle)]) / 3
    best = angle[np.abs(lines - np.round(lines)).max(axis=0).argmin()]
    across = top @ np.array([np.cos(best), np.sin(best)])
    number = np.round(across / 3)
    assert np.abs(across - 3 * number).max() < 0.05
    assert len(np.unique(number)) > 15


def test_lines_are_hidden_as_points_are(cuboid: Part) -> None:
    clamp = {"tool": "box", "centre": (0, 0, 30), "size": (20, 20, 4)}
    scan = simulate(cuboid, surroundings=[clamp], scanners=[(0, 0, 3000)], stripes=1.0)
    top = scan.points[np.abs(scan.points[:, 2] - 15) < 1e-3]
    assert len(top) > 10_000
    assert np.abs(top[:, :2]).max(axis=1).min() > 9.9


def test_patches_are_the_share_of_the_skin_that_has_no_points(cuboid: Part) -> None:
    even, bare = (simulate(cuboid, patches=share, patch_size=16.0, points=40_000).points for share in (0.0, 0.3))
    from scipy.spatial import KDTree

    gap = KDTree(bare).query(even)[0]
    assert (gap > 1.0).mean() == pytest.approx(0.27, abs=0.05)
    assert 4 < gap.max() < 25
    seen = simulate(cuboid, patches=0.3, patch_size=16.0, scanners=3).points
    assert len(seen) == 20_000
    assert KDTree(bare).query(seen)[0].max() < 1.5, "the same patches, seen by scanners"


@pytest.mark.parametrize("scanners", [None, 4])
def test_every_second_point_of_a_sheet_is_off_the_skin(cuboid: Part, scanners: int | None) -> None:
    scan = simulate(cuboid, sheets=0.2, sheet_offset=0.5, patch_size=10.0, scanners=scanners, max_incidence=60)
    distance = off(scan, cuboid)
    sheet = distance > 0.2
    assert sheet.mean() == pytest.approx(0.1, abs=0.04)
    assert distance[sheet].max() < 0.5 + 1e-3
    assert np.abs(distance[~sheet]).max() < 1e-3
    from scipy.spatial import KDTree

    near = KDTree(scan.points[~sheet]).query(scan.points[sheet])[0]
    assert np.median(near) < 1.0, "the skin has points behind its sheets"
    behind = simulate(cuboid, sheets=0.2, sheet_offset=-0.5, patch_size=10.0)
    assert off(behind, cuboid).min() < -0.4


def test_a_shared_waviness_is_the_same_in_all_views(cuboid: Part) -> None:
    places = [(0, 300, 300), (0, -300, 300)]

    def compare(is_shared: bool) -> float:
        options = {"waviness": 0.2, "wavelength": 30, "waviness_shared": is_shared, "scanners": places}
        scan = simulate(cuboid, **options)
        assert scan.view is not None
        top = np.abs(scan.points[:, 2] - 15) < 1
        first, second = (scan.points[top & (scan.view == k)] for k in (0, 1))
        from scipy.spatial import KDTree

        other = second[KDTree(second[:, :2]).query(first[:, :2])[1]]
        return float(np.abs(first[:, 2] - other[:, 2]).mean())

    assert compare(True) < 0.03
    assert compare(False) > 0.1


def test_the_true_pose_of_a_scan_of_another_scale_holds_at_the_middle_of_the_part() -> None:
    part = PARTS["blade"]()
    right, wrong = (simulate(part, scale=scale, pose="random") for scale in (1.0, 1.01))
    assert right.truth is not None
    assert wrong.truth is not None
    points, larger = (scan.move(scan.truth.T_part_scan).points for scan in (right, wrong) if scan.truth is not None)
    middle = part.bounds.mean(axis=0)
    assert np.allclose(larger - middle, 1.01 * (points - middle))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"stripes": 1.0}, "scanners"),
        ({"noise_growth": 2}, "scanners"),
        ({"noise_slant": 1}, "scanners"),
        ({"depth_growth": 2, "depth_step": 1}, "scanners"),
        ({"depth_growth": 2, "scanners": 1}, "depth_step"),
        ({"sheets": 0.1}, "sheet_offset"),
    ],
)
def test_options_that_need_others_say_so(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ValidationError, match=said):
        Simulate(**options)


def test_the_same_job_gives_the_same_points(cuboid: Part) -> None:
    options = {"noise": 0.1, "noise_growth": 2, "noise_slant": 1, "noise_along": "ray", "depth_step": 0.2}
    options |= {"depth_growth": 2, "stripes": 1.0, "patches": 0.1, "sheets": 0.1, "sheet_offset": 0.4, "scanners": 3}
    first, second = (simulate(cuboid, **options).points for _ in range(2))
    assert np.array_equal(first, second)
