"""Wear within the tolerance, on parts whose worn points are known."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from manifold3d import Manifold

import damageest
from damageest.artefacts import DAMAGE, Floats, Part, Scan
from damageest.geometry.solids import to_arrays
from damageest.stages.scan.simulate import Simulate
from damageest.stages.segment._wear import Wear, find_wear
from damageest.stages.segment.mesh_distance import MeshDistance, signed_distance

SIGMA = 0.02
SIZE = np.array([40.0, 30.0, 1.0])
PER_AREA = 12
TOLERANCE = 4 * SIGMA


@lru_cache
def plate() -> Part:
    mesh = trimesh.creation.box(SIZE)
    return Part(mesh.vertices, mesh.faces)


def scan_plate(shift: float = 0.0, bend: float = 0.0) -> Floats:
    """Points (N,3) on both faces of the thin plate, upper ones first, with noise; moved up, or bent in waves."""
    rng = np.random.default_rng(3)
    count = int(PER_AREA * SIZE[0] * SIZE[1])
    xy = rng.uniform(-0.5, 0.5, (2 * count, 2)) * SIZE[:2]
    z = np.repeat([0.5, -0.5], count) * SIZE[2] + shift + bend * np.sin(xy[:, 0] / 3)
    return np.column_stack([xy, z]) + rng.normal(0, SIGMA, (2 * count, 3))


def find(points: Floats, tolerance: float = TOLERANCE) -> Wear:
    scan = Scan(points, noise=SIGMA, spacing=1.1 / np.sqrt(PER_AREA))
    distance, face = signed_distance(points, plate())
    return find_wear(scan, plate(), distance, face, tolerance)


def make_worn_patch(depth: float) -> tuple[Floats, np.ndarray]:
    """The plate with a patch of its upper face lowered, and which points those are."""
    points = scan_plate()
    patch = (np.abs(points[:, 0] + 8) < 6) & (np.abs(points[:, 1]) < 8) & (points[:, 2] > 0)
    points[patch, 2] -= depth
    return points, patch


@pytest.mark.parametrize(("depth", "share"), [(2.0, 0.85), (3.0, 0.94), (4.0, 0.97)])
def test_wear_within_the_tolerance_is_find(depth: float, share: float) -> None:
    points, patch = make_worn_patch(depth * SIGMA)
    alone = signed_distance(points, plate())[0] < -TOLERANCE
    assert alone[patch].mean() < 0.55  # by single points
    result = find(points)
    seen = result.worn | alone
    assert seen[patch].mean() > share
    # Wear deeper than twice the threshold is found slightly beyond its rim.
    assert result.worn[~patch].sum() < 0.05 * patch.sum()


def test_its_rim_is_in_the_right_place() -> None:
    points, patch = make_worn_patch(3 * SIGMA)
    seen = find(points).worn | (signed_distance(points, plate())[0] < -TOLERANCE)
    assert seen.sum() == pytest.approx(patch.sum(), rel=0.03)


def test_the_other_face_of_a_thin_wall_is_not_worn() -> None:
    points, _ = make_worn_patch(3 * SIGMA)
    assert not find(points).worn[len(points) // 2 :].any()


def test_nothing_is_worn_on_an_intact_plate() -> None:
    result = find(scan_plate())
    assert not result.worn.any()
    assert result.threshold == pytest.approx(1.5 * SIGMA)
    assert not result.notes


@pytest.mark.parametrize(("shift", "bend"), [(1.8, 0.0), (0.0, 2.0), (2.5, 1.0)])
def test_errors_of_pose_or_form_are_not_wear(shift: float, bend: float) -> None:
    result = find(scan_plate(shift * SIGMA, bend * SIGMA))
    assert not result.worn.any()
    assert "over whole areas" in result.notes[0]


def test_a_tolerance_wider_than_the_noise_needs_is_respected() -> None:
    points, patch = make_worn_patch(5 * SIGMA)
    assert not find(points, 10 * SIGMA).worn.any()
    assert find(points, 5 * SIGMA).worn[patch].mean() > 0.9


def test_too_few_points_are_not_wear() -> None:
    points, patch = make_worn_patch(3 * SIGMA)
    few = patch & (np.abs(points[:, 0] + 8) < 1) & (np.abs(points[:, 1]) < 1)
    points[patch & ~few, 2] += 3 * SIGMA
    assert few.sum() > 30
    assert not find(points).worn.any()


def test_the_option_turns_it_off() -> None:
    points, patch = make_worn_patch(3 * SIGMA)
    scan = Scan(points, noise=SIGMA, spacing=1.1 / np.sqrt(PER_AREA))
    with_wear, without = (
        MeshDistance(wear=on).run(scan, plate(), TOLERANCE).label[patch] == DAMAGE for on in (True, False)
    )
    assert with_wear.mean() > 0.9
    assert 0.05 < without.mean() < 0.3


def test_without_measured_noise_nothing_is_worn() -> None:
    points, _ = make_worn_patch(3 * SIGMA)
    plain = MeshDistance(wear=False).run(Scan(points), plate(), TOLERANCE).label
    assert np.array_equal(MeshDistance().run(Scan(points), plate(), TOLERANCE).label, plain)


def wear_of(name: str, depth: float, folder: Path) -> dict[str, object]:
    """Wear of a tenth of a part's surface: a face, a bearing seat of radius 18, a bore of radius 16."""
    if name == "cuboid":
        return {"tool": "box", "centre": [-10, 5, 15], "size": [40, 35, 2 * depth]}
    if name == "tube":
        return {"tool": "cylinder", "point": [0, 0, -33], "axis": [0, 0, 1], "length": 26, "radius": 16 + depth}
    ring = Manifold.cylinder(16, 20, 20, 512) - Manifold.cylinder(16, 18 - depth, 18 - depth, 512)
    trimesh.Trimesh(*to_arrays(ring.translate((0, 0, -16)))).export(folder / "ring.stl")
    return {"tool": "mesh", "path": str(folder / "ring.stl")}


@pytest.mark.variants(slow=1)
@pytest.mark.parametrize("name", [pytest.param(name, marks=pytest.mark.slow) for name in ("cuboid", "shaft", "tube")])
def test_volume_of_wear_of_three_sigma(name: str, tmp_path: Path) -> None:
    """A tenth of the surface worn by three quarters of the tolerance: most points are within it. In unknown pose."""
    part = PARTS[name]()
    sigma = 0.0005 * part.diagonal
    tool = wear_of(name, 3 * sigma, tmp_path)
    options = {"damage": [tool], "points": 150_000, "noise": sigma, "pose": "random"}
    scan = Simulate.model_validate(options).run("mm", part)
    assert scan.truth is not None
    assert scan.truth.damage is not None
    result = damageest.run({"version": 1, "tolerance": 4 * sigma}, part=part, scan=scan)
    assert len(result.sites) == 1
    assert result.sites[0].evidence.consistent
    assert result.sites[0].damage.volume == pytest.approx(scan.truth.damage.volume, rel=0.1)
    assert result.truth is not None
    assert result.truth[1] > 0.8


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["cuboid", *(pytest.param(name, marks=pytest.mark.slow) for name in ("coupling", "blade"))]
)
def test_intact_parts_have_no_site(name: str) -> None:
    scan = Simulate.model_validate({"points": 15_000, "density": 0.4}).run("mm", PARTS[name]())
    result = damageest.run({"version": 1, "align": "icp"}, part=PARTS[name](), scan=scan)
    assert not result.sites
