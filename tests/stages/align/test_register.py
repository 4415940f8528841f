"""Alignment without an initial pose finds the pose to a fraction of the noise, or raises an error."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from align_scenes import error, scene
from damageest_benchmarks.parts import PARTS
from damageest_benchmarks.troubles.case import make_scan, make_scene
from damageest_benchmarks.troubles.suite import make_trouble_cases
from damageest_evaluate.scores import measure_pose_error

from damageest.artefacts import Scan
from damageest.errors import StageError
from damageest.stages.align.register import Register
from damageest.stages.scan.simulate import Simulate


@pytest.mark.slow
@pytest.mark.parametrize("name", ["block", "blade", "half_torus", "grille"])
def test_pose_with_a_third_missing(name: str) -> None:
    part, scan = scene(name, seed=3, missing=0.33)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert error(part, pose.T_part_scan, scan) < 0.5
    assert np.allclose(pose.T_part_scan[:3, :3] @ pose.T_part_scan[:3, :3].T, np.eye(3), atol=1e-12)
    assert 0.5 * scan.noise < pose.rms < 2 * scan.noise


@pytest.mark.slow
@pytest.mark.parametrize(
    "points", [2000, *(pytest.param(points, marks=pytest.mark.slow) for points in (9999, 10_000, 10_001))]
)
def test_scans_with_fewer_points_than_the_comparisons_take(points: int) -> None:
    """Poses are compared on the first 1,500 points, then the next 8,500, then the rest: a small scan has no rest."""
    part, scan = scene("block", seed=3, missing=0.2, clutter=0.0, points=points)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert error(part, pose.T_part_scan, scan) < 1


@pytest.mark.slow
def test_a_dense_scan_whose_noise_is_larger_than_the_gaps_between_its_points() -> None:
    """Its normals need more neighbours: the nearest 64 all lie within the noise, and show no plane."""
    part = PARTS["lever"]()
    scan = Simulate(points=60_000, noise=0.6, pose="random", seed=3).run("mm", part)
    scan = replace(scan, noise=0.6)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert error(part, pose.T_part_scan, scan) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lever", "block"])
def test_pose_with_a_third_unseen(name: str) -> None:
    part, scan = scene(name, seed=4, missing=0.05, unseen=0.33)
    assert error(part, Register().run(scan, part, 4 * scan.noise).T_part_scan, scan) < 0.5


@pytest.mark.slow
def test_keyway_decides() -> None:
    part, scan = scene("keyed_shaft", seed=5, missing=0.05)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert error(part, pose.T_part_scan, scan) < 0.5


@pytest.mark.slow
def test_continuous_symmetry_is_noted_and_all_alternatives_are_right() -> None:
    part, scan = scene("cylinder", seed=6, missing=0.1)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert any("any angle" in note for note in pose.notes)
    assert pose.alternatives is not None
    assert max(error(part, T, scan) for T in [pose.T_part_scan, *pose.alternatives]) < 1


@pytest.mark.slow
def test_both_ends_of_a_cylinder_are_listed() -> None:
    """Poses that differ by a turn about the axis fit alike, and there are more of them than are compared."""
    part, scan = scene("cylinder", seed=7, missing=0.0)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert pose.alternatives is not None
    ends = [float(pose.T_part_scan[2, :3] @ T[2, :3]) for T in pose.alternatives]
    assert min(ends) < -0.99 < 0.99 < max(ends)


@pytest.mark.slow
def test_two_fractures_that_are_nearly_parallel_to_the_skin() -> None:
    """A third of the metal is gone, half of the scan lies inside the part, and tilted poses fit the fractures."""
    part = PARTS["cuboid"]()
    tools = [
        {
            "tool": "plane",
            "point": [-0.8, -1.7, -13.4],
            "normal": [-0.062, -0.128, -0.99],
            "roughness": 0.28,
            "seed": 1,
        },
        {"tool": "plane", "point": [-1.8, -0.2, 6.5], "normal": [-0.268, -0.029, 0.963], "roughness": 0.05, "seed": 2},
    ]
    noise = 0.0005 * part.diagonal
    options = {"damage": tools, "points": 60_000, "noise": noise, "density": 0.4, "pose": "random", "seed": 4012}
    scan = replace(Simulate.model_validate(options).run("mm", part), noise=noise)
    for seed in (0, 1):
        pose = Register(seed=seed).run(scan, part, 4 * noise)
        assert pose.alternatives is not None
        assert min(error(part, T, scan) for T in [pose.T_part_scan, *pose.alternatives]) < 0.5
        assert "another_part" in [doubt.code for doubt in pose.doubts]


@pytest.mark.slow
def test_the_same_pose_with_one_thread_and_with_two(monkeypatch: pytest.MonkeyPatch) -> None:
    part, scan = scene("cuboid", seed=3, missing=0.1)
    poses = []
    for threads in ("1", "2"):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        poses.append(Register().run(scan, part, 4 * scan.noise).T_part_scan.tobytes())
    assert poses[0] == poses[1]


@pytest.mark.slow
def test_a_scan_that_does_not_fix_the_pose_is_noted() -> None:
    part, scan = scene("cylinder", seed=6, clutter=0.0)
    assert scan.truth is not None
    height = (scan.move(scan.truth.T_part_scan).points - part.bounds.mean(0))[:, 2] / (part.bounds[1] - part.bounds[0])[
        2
    ]
    ends_unseen = Scan(scan.points[np.abs(height) < 0.4], noise=scan.noise)
    pose = Register().run(ends_unseen, part, 4 * scan.noise)
    assert any("does not fix the pose" in note for note in pose.notes)
    whole = Register().run(scan, part, 4 * scan.noise)
    assert not any("does not fix" in note for note in whole.notes)


@pytest.mark.slow
def test_discrete_symmetry_is_noted() -> None:
    part, scan = scene("cuboid", seed=7, missing=0.05, points=8000)
    pose = Register().run(scan, part, 4 * scan.noise)
    assert pose.alternatives is not None
    assert len(pose.alternatives) == 3
    assert any("4 poses" in note for note in pose.notes)
    assert max(error(part, T, scan) for T in pose.alternatives) < 1


@pytest.mark.slow
def test_same_bytes_again() -> None:
    part, scan = scene("block", seed=8, missing=0.1)
    first, second = (Register(seed=1).run(scan, part, 4 * scan.noise) for _ in range(2))
    assert first.T_part_scan.tobytes() == second.T_part_scan.tobytes()
    assert (first.rms, first.inliers, first.notes) == (second.rms, second.inliers, second.notes)


@pytest.mark.slow
def test_noise_not_measured_and_no_outliers() -> None:
    part, scan = scene("block", seed=9, clutter=0.0)
    bare = Scan(scan.points)
    assert error(part, Register().run(bare, part, 4 * scan.noise).T_part_scan, scan) < 0.5


@pytest.mark.slow
def test_another_part_is_refused() -> None:
    part, _ = scene("block", seed=0)
    other, scan = scene("half_torus", seed=1)
    scale = part.diagonal / other.diagonal
    with pytest.raises(StageError, match=r"no pose found.*%") as caught:
        Register().run(Scan(scan.points * scale, noise=scan.noise * scale), part, 4 * scan.noise * scale)
    assert "check part, scan and units" in caught.value.remedy


@pytest.mark.slow
def test_mirror_image_is_refused() -> None:
    part, scan = scene("ribbed_plate", seed=1)
    with pytest.raises(StageError, match="mirror image") as caught:
        Register().run(Scan(scan.points * [1, 1, -1], noise=scan.noise), part, 4 * scan.noise)
    assert "left-hand" in caught.value.remedy


@pytest.mark.slow
def test_a_displaced_piece_does_not_shift_the_pose() -> None:
    part, scan = scene("lever", seed=5, clutter=0.0)
    assert scan.truth is not None
    T, tolerance = scan.truth.T_part_scan, 4 * scan.noise
    points = scan.move(T).points.copy()
    points[points[:, 0] > np.quantile(points[:, 0], 0.74)] += 4 * tolerance * np.array([0.6, 0.5, 0.62])
    broken = Scan(points, noise=scan.noise, truth=scan.truth).move(np.linalg.inv(T))
    assert error(part, Register().run(broken, part, tolerance).T_part_scan, broken) * scan.noise < 0.3 * tolerance


def test_inches_read_as_millimetres_are_reported() -> None:
    part, scan = scene("block", seed=2, points=2000)
    with pytest.raises(StageError, match="unit"):
        Register().run(Scan(scan.points / 25.4), part, 0.1)


def test_too_few_points() -> None:
    part, scan = scene("block", seed=2, points=2000)
    with pytest.raises(StageError, match="50 points"):
        Register().run(Scan(scan.points[:50]), part, 0.1)


@pytest.mark.slow
def test_both_ways_up_of_a_gear_are_listed_where_steps_blur_the_search() -> None:
    """One view by a depth camera: copies of poses that were found twice had crowded out one of the right two."""
    case = make_trouble_cases(numbers=[157])[0]
    scene_ = make_scene(case)
    scan, pose = make_scan(case, scene_)
    found = Register().run(replace(scan, noise=1 / np.sqrt(12)), scene_.part, 1.5)
    known = [found.T_part_scan, *(found.alternatives if found.alternatives is not None else ())]
    assert min(measure_pose_error(scene_.part, one, pose)[1] for one in known) < 1.0
