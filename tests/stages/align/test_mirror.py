"""A mirror image is refused where enough of the part shows it; a right scan of a little of the part is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from align_scenes import cut_strip, make_bracket, measure_apart, scene, watch_by_camera

from damageest.artefacts import Part, Scan
from damageest.errors import StageError
from damageest.geometry.sampling import sample_by_area
from damageest.stages.align.none import KnownPose
from damageest.stages.align.register import Register


def is_refused(part: Part, scan: Scan, tolerance: float) -> bool:
    """Whether a scan is refused as a mirror image."""
    try:
        Register().run(scan, part, tolerance)
    except StageError as refused:
        return "mirror" in str(refused)
    return False


def mirror(scan: Scan) -> Scan:
    return Scan(scan.points * [1, 1, -1], noise=scan.noise)


@pytest.mark.slow
def test_the_waves_of_a_camera_are_no_mirror_image() -> None:
    part = make_bracket()
    scan, _ = watch_by_camera(part, 302, 7004, 0.5)
    pose = Register().run(Scan(scan.points, noise=0.29, truth=scan.truth), part, 1.5)
    assert measure_apart(part, pose.T_part_scan, scan) < 0.03


@pytest.mark.slow
def test_a_strip_of_a_mirror_image_is_not_refused() -> None:
    """A few faces have a mirror image that fits another place of the part: too little to refuse a scan for."""
    part, scan = cut_strip("block", 1000, 0.1, points=6000)
    assert not is_refused(part, mirror(scan), 4 * scan.noise)


@pytest.mark.slow
def test_a_mirror_image_in_a_given_pose_is_refused() -> None:
    """The pose is the one in which most of it lies on the part; part of what is mirrored lies outside."""
    part, scan = scene("block", 50, points=8000)
    assert scan.truth is not None
    aligned = mirror(scan.move(scan.truth.T_part_scan))
    with pytest.raises(StageError, match="mirror image"):
        KnownPose().run(replace(aligned, noise=scan.noise), part, 4 * scan.noise)


@pytest.mark.variants(slow=8)
@pytest.mark.slow
@pytest.mark.parametrize("k", range(24))
def test_right_strips_are_not_refused(k: int) -> None:
    """Case 6 is half a torus whose mirrored pose was found, and the right one was not."""
    names = ("block", "lever", "ribbed_plate", "blade", "tube", "keyed_shaft", "half_torus", "cuboid", "gear", "grille")
    share, scale = (0.03, 0.05, 0.1, 0.04, 0.07)[(3 * k + k // 10) % 5], (1.0, 1.0, 1.0038, 1.0)[k % 4]
    part, scan = cut_strip(names[k % 10], 1000 + k, share, scale)
    assert not is_refused(part, scan, 4 * scan.noise)


@pytest.mark.slow
@pytest.mark.parametrize("view", [(1, 1, 1), (1, 1, -1)])
def test_a_mirror_image_half_seen_is_refused(view: tuple[int, int, int]) -> None:
    """What both hands explain of it is symmetric; what only one explains is not."""
    boxes = [trimesh.creation.box(size) for size in ((60, 33, 8), (8, 33, 40), (30, 6, 14))]
    for one, at in zip(boxes, ((0, 0, 0), (-26, 0, 16), (0, -13.5, 7)), strict=True):
        one.apply_translation(at)
    cut = trimesh.creation.box((20, 12, 12))
    cut.apply_translation((-30, 16, 34))
    bracket = trimesh.boolean.difference([trimesh.boolean.union(boxes, engine="manifold"), cut], engine="manifold")
    part, rng = Part(bracket.vertices, bracket.faces), np.random.default_rng(0)
    points, face = sample_by_area(part, 10_000, rng)
    seen = points[part.face_normals[face] @ np.array(view) > 0]
    scan = Scan(seen + rng.normal(scale=0.025, size=seen.shape), noise=0.025)
    assert is_refused(part, mirror(scan), 0.1)
    assert not is_refused(part, scan, 0.1)


@pytest.mark.variants(slow=5)
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50, 53))
@pytest.mark.parametrize("name", ["ribbed_plate", "block", "blade", "tube"])
def test_mirror_images_of_parts_well_seen_are_refused(name: str, seed: int) -> None:
    part, scan = scene(name, seed, missing=0.05 * (seed % 2), unseen=0.4 * (seed % 3 == 0), points=20_000)
    assert is_refused(part, mirror(scan), 4 * scan.noise)


def make_hook() -> Part:
    """A stem with an arm and a foot in different directions, each of its own length: no plane mirrors it nearly."""
    boxes = [trimesh.creation.box(size) for size in ((60, 8, 8), (8, 30, 8), (8, 8, 18))]
    for one, at in zip(boxes, ((0, 0, 0), (26, 15, 0), (-20, 0, 10)), strict=True):
        one.apply_translation(at)
    hook = trimesh.boolean.union(boxes, engine="manifold")
    return Part(hook.vertices, hook.faces)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_other_hand_of_an_undamaged_part_is_refused_and_its_own_is_not(seed: int) -> None:
    part, rng = make_hook(), np.random.default_rng(seed)
    points = sample_by_area(part, 12_000, rng)[0] + rng.normal(0, 0.03, (12_000, 3))
    turn = trimesh.transformations.random_rotation_matrix(rng.random(3))[:3, :3]
    scan = Scan(points @ turn.T + rng.uniform(-50, 50, 3), noise=0.03)
    assert is_refused(part, mirror(scan), 0.15)
    assert not is_refused(part, scan, 0.15)


@pytest.mark.slow
@pytest.mark.parametrize("turned", [True, False])
def test_normals_that_were_left_behind_tell_that_the_scan_was_mirrored(turned: bool) -> None:
    """Points mirrored with the corners of each triangle in their old order have normals that point inward."""
    part = make_hook()
    points, face = sample_by_area(part, 8000, np.random.default_rng(1))
    flip = np.array([1.0, 1.0, -1.0])
    normals = part.face_normals[face] * flip * (-1 if turned else 1)
    with pytest.raises(StageError, match="mirror image") as refused:
        Register().run(Scan(points * flip, normals=normals, noise=0.02), part, 0.2)
    assert ("the scan was mirrored" in str(refused.value)) == turned
