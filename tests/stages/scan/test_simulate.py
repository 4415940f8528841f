"""The virtual scanner: the truth it states is the truth, and its points lie on it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import igl
import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from manifold3d import Manifold
from pydantic import ValidationError

from damageest.artefacts import Floats, Mesh, Part
from damageest.errors import StageError
from damageest.geometry.bodies import split_shells
from damageest.geometry.solids import to_arrays, to_manifold, to_solid
from damageest.stages.scan.scanner import apply_tools
from damageest.stages.scan.simulate import Simulate
from damageest.stages.scan.tools import PlaneTool

SPHERE = {"tool": "sphere", "centre": (35, 25, 15), "radius": 10}


@pytest.fixture(scope="module")
def cuboid() -> Part:
    """70 x 50 x 30 about the origin."""
    return PARTS["cuboid"]()


def simulate(part: Part, *damage: dict[str, Any], **options: Any) -> Any:
    return Simulate(damage=damage, **{"points": 20_000, **options}).run("mm", part)


def distance(points: Floats, mesh: Mesh) -> Floats:
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    return np.sqrt(igl.point_mesh_squared_distance(np.array(points), vertices, faces)[0])


def damaged(part: Part, damage: Mesh) -> Mesh:
    return Mesh(*to_arrays(to_manifold(part) - to_manifold(damage)))


@pytest.mark.parametrize(
    ("tool", "volume", "tolerance"),
    [
        (SPHERE, 4 / 3 * math.pi * 1000 / 8, 2e-3),
        ({"tool": "box", "centre": (35, 0, 0), "size": (10, 20, 12)}, 5 * 20 * 12, 1e-9),
        ({"tool": "box", "centre": (0, 0, 15), "size": (10, 10, 20), "rotation": (0, 0, 30)}, 1000, 1e-9),
        ({"tool": "cylinder", "point": (0, 0, 20), "axis": (0, 0, -3), "radius": 5, "length": 50}, 750 * math.pi, 2e-3),
        ({"tool": "plane", "point": (25, 0, 0), "normal": (2, 0, 0)}, 15_000, 1e-9),
        ({"tool": "plane", "point": (0, 0, 10), "normal": (0, 0, 1), "within": 8}, 320 * math.pi, 2e-3),
        ({"tool": "plane", "point": (20, 0, 0), "normal": (1, 0, 0), "roughness": 0.5}, 22_500, 0.03),
        ({"tool": "box", "centre": (35, 0, 0), "size": (20, 20, 12), "roughness": 0.2}, 2_400, 0.05),
        ({"tool": "blob", "centre": (0, 0, 15), "radius": 8, "roughness": 0}, 2 / 3 * math.pi * 512, 4e-3),
    ],
)
def test_the_true_volume_is_the_tools_within_the_part(
    cuboid: Part, tool: dict[str, Any], volume: float, tolerance: float
) -> None:
    damage = simulate(cuboid, tool).truth.damage
    assert damage.volume == pytest.approx(volume, rel=tolerance)
    outside = to_manifold(damage) - to_manifold(cuboid)
    assert outside.volume() <= 1e-9 * cuboid.volume


@pytest.mark.variants(1)
@pytest.mark.parametrize("name", ["gear", "blade", "grille", "tube"])
def test_points_lie_on_the_damaged_surface(name: str) -> None:
    part = PARTS[name]()
    high = part.bounds[1]
    tools = [
        {"tool": "plane", "point": tuple(0.7 * high), "normal": (1, 1, 0.3), "roughness": 0.3},
        {"tool": "blob", "centre": tuple(part.vertices[0]), "radius": 7},
    ]
    scan = simulate(part, *tools, noise=0.05)
    left = damaged(part, scan.truth.damage)
    found = distance(scan.points, left)
    assert len(scan.points) == 20_000
    assert found.max() < 5 * 0.05
    # the distance to a plane of isotropic noise: half normal; edges and corners pull it down only little
    assert np.sqrt((found**2).mean()) == pytest.approx(0.05, rel=0.1)


def test_points_are_even_over_the_area(cuboid: Part) -> None:
    points = simulate(cuboid, noise=0, points=100_000).points
    top = (points[:, 2] > 15 - 1e-9).mean()
    assert top == pytest.approx(70 * 50 / cuboid.area, abs=5e-3)


def test_uneven_density_thins_some_of_the_surface_and_keeps_the_number(cuboid: Part) -> None:
    cells = [
        np.histogram2d(*points[points[:, 2] > 14.9][:, :2].T, bins=(7, 5))[0]
        for points in (simulate(cuboid, density=d, noise=0, points=100_000).points for d in (0, 0.6))
    ]
    even, uneven = (c.std() / c.mean() for c in cells)
    assert even < 0.1
    assert uneven > 0.3
    assert cells[1].min() > 0


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others(cuboid: Part) -> None:
    options: dict[str, Any] = {"density": 0.5, "outliers": 0.02, "pose": "random"}
    blob = {"tool": "blob", "centre": (35, 0, 0), "radius": 9}
    a, b = (simulate(cuboid, blob, **options, seed=3) for _ in range(2))
    other = simulate(cuboid, blob, **options, seed=4)
    assert a.points.tobytes() == b.points.tobytes()
    assert a.truth.damage.vertices.tobytes() == b.truth.damage.vertices.tobytes()
    assert a.truth.T_part_scan.tobytes() == b.truth.T_part_scan.tobytes()
    assert not np.array_equal(a.points, other.points)
    assert not np.allclose(a.truth.T_part_scan, other.truth.T_part_scan)


def test_the_pose_is_applied_to_the_points_and_its_inverse_stated(cuboid: Part) -> None:
    pose = trimesh.transformations.euler_matrix(0.3, -0.7, 2.0)
    pose[:3, 3] = 100, -50, 7
    still = simulate(cuboid, SPHERE, seed=1)
    moved = simulate(cuboid, SPHERE, seed=1, pose=tuple(map(tuple, pose)))
    assert np.allclose(moved.points, still.points @ pose[:3, :3].T + pose[:3, 3], atol=1e-10)
    assert np.allclose(moved.truth.T_part_scan, np.linalg.inv(pose), atol=1e-12)
    assert np.allclose(moved.truth.damage.vertices, still.truth.damage.vertices)
    assert np.array_equal(still.truth.T_part_scan, np.eye(4))


def test_a_random_pose_is_rigid_and_undone_by_the_truth(cuboid: Part) -> None:
    scan = simulate(cuboid, pose="random", noise=0)
    turn = scan.truth.T_part_scan[:3, :3]
    assert np.allclose(turn @ turn.T, np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1)
    back = scan.move(scan.truth.T_part_scan).points
    assert distance(back, cuboid).max() < 1e-9
    assert distance(scan.points, cuboid).max() > 1


def test_an_unseen_direction_carries_no_points(cuboid: Part) -> None:
    points = simulate(cuboid, noise=0, unseen=[{"direction": (0, 0, -5), "angle": 45}]).points
    inner = (np.abs(points[:, 0]) < 34.9) & (np.abs(points[:, 1]) < 24.9)
    assert len(points) == 20_000
    assert (points[inner][:, 2] > 14).all()
    assert (points[:, 2] < -14).any()  # the sides reach down to the edge


def test_nothing_is_seen_beyond_a_plane(cuboid: Part) -> None:
    points = simulate(cuboid, noise=0, unseen=[{"direction": (1, 0, 0), "beyond": (10, 0, 0)}], density=0.3).points
    assert len(points) == 20_000
    assert points[:, 0].max() <= 10
    assert points[:, 0].max() > 9.9


def test_the_share_of_outliers(cuboid: Part) -> None:
    points = simulate(cuboid, noise=0, outliers=0.1).points
    assert len(points) == 20_000
    assert (distance(points, cuboid) > 1e-6).sum() == 2_000


def test_undamaged(cuboid: Part) -> None:
    scan = simulate(cuboid)
    assert scan.truth.damage is None
    assert scan.normals is None
    assert distance(scan.points, cuboid).max() < 5 * 0.0005 * cuboid.diagonal


def test_a_piece_cut_loose_is_damage_too(cuboid: Part) -> None:
    scan = simulate(cuboid, {"tool": "box", "centre": (20, 0, 0), "size": (4, 80, 80)}, noise=0)
    assert scan.truth.damage.volume == pytest.approx((4 + 13) * 50 * 30)
    assert scan.points[:, 0].max() <= 18 + 1e-9
    assert any("cut loose" in note for note in scan.notes)


def test_a_mesh_as_tool(cuboid: Part, tmp_path: Path) -> None:
    trimesh.creation.box((10, 10, 10)).export(tmp_path / "tool.stl")
    T = np.eye(4)
    T[:3, 3] = 35, 0, 0
    scan = simulate(cuboid, {"tool": "mesh", "path": tmp_path / "tool.stl", "transform": tuple(map(tuple, T))})
    assert scan.truth.damage.volume == pytest.approx(500)


def test_far_from_the_origin_nothing_is_lost() -> None:
    near = PARTS["cuboid"]()
    far = Part(near.vertices + 1e6, near.faces, unit="mm")
    tool = {**SPHERE, "centre": tuple(1e6 + np.array(SPHERE["centre"]))}
    volumes = [simulate(near, SPHERE).truth.damage.volume, simulate(far, tool).truth.damage.volume]
    assert volumes[1] == pytest.approx(volumes[0], rel=1e-6)


@pytest.mark.parametrize("sliver", [None, 1e-12, 0.0, -1e-12])
def test_a_cavity_stays_one_also_beside_slivers(sliver: float | None) -> None:
    """A sliver without volume, as a union of bodies can leave, whose box holds the cavity, does not own it."""
    block = to_solid(Manifold.cube((10, 10, 10)) - Manifold.cube((1, 1, 1)).translate((1, 1, 1)))
    assert block is not None
    vertices, faces = block.vertices, block.faces
    if sliver is not None:
        flat = [[-1, 4, 4], [4, -1, 4], [4, 4, -1], [7 / 3, 7 / 3, 7 / 3 + sliver]]
        around = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]) + len(vertices)
        vertices, faces = np.concatenate([vertices, flat]), np.concatenate([faces, around])
    part = Part(vertices, faces, unit="mm")
    for reach in (6.6, 7.5):
        tool = PlaneTool(point=(reach, 0, 0), normal=(1, 1, 1))
        left, damage, _ = apply_tools(part, [tool])
        assert damage is not None
        assert left.volume == pytest.approx(reach**3 / 6 - 1, rel=1e-9)
        assert damage.volume == pytest.approx(1000 - reach**3 / 6, rel=1e-9)
        assert len(split_shells(left)) == 1


@pytest.mark.parametrize(
    ("tools", "says"),
    [
        ([SPHERE, {**SPHERE, "centre": (90, 0, 0)}], r"tool 2 \(sphere\) misses the part"),
        ([{**SPHERE, "radius": 200}], "whole part"),
        ([{**SPHERE, "centre": (0, 0, 0)}], "closed cavity"),
    ],
)
def test_what_cannot_be_scanned_is_refused(cuboid: Part, tools: list[dict[str, Any]], says: str) -> None:
    with pytest.raises(StageError, match=says) as caught:
        simulate(cuboid, *tools)
    assert caught.value.remedy


def test_a_scanner_that_sees_nothing_is_refused(cuboid: Part) -> None:
    for unseen in ({"direction": (1, 0, 0), "angle": 180}, {"direction": (1, 0, 0), "beyond": (-99, 0, 0)}):
        with pytest.raises(StageError, match="sees nothing"):
            simulate(cuboid, unseen=[unseen])


@pytest.mark.parametrize(
    "options",
    [
        {"damage": [{"tool": "plane", "point": (0, 0, 0), "normal": (0, 0, 0)}]},
        {"damage": [{"tool": "sphere", "centre": (0, 0, 0), "radius": -1}]},
        {"damage": [{"tool": "saw"}]},
        {"pose": tuple(map(tuple, 2 * np.eye(4)))},
        {"outliers": 1.0},
    ],
)
def test_options_out_of_bounds_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Simulate(**options)
