"""Normals of a scan that point inward, some or all, lead to no other pose, and it is said."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from align_scenes import error, scene

import damageest
from damageest.artefacts import Floats, Part, Scan
from damageest.stages.align.handedness.normals import SignedNormals
from damageest.stages.align.register import Register
from damageest.stages.align.surface.plane_grid import PartSurface


def make_signs(kind: str, count: int) -> Floats:
    if kind == "random":
        return np.random.default_rng(0).choice([-1.0, 1.0], count)
    if kind == "views":  # each second one of four
        return np.where(np.arange(count) * 4 // count % 2 == 0, 1.0, -1.0)
    return np.full(count, 1.0 if kind == "right" else -1.0)


@pytest.fixture(scope="module")
def outward() -> tuple[Part, Scan]:
    """A scan of a block with normals, in the order of its points along the part."""
    part, scan = scene("block", seed=3, missing=0.05, points=3000)
    assert scan.truth is not None
    T = scan.truth.T_part_scan
    aligned = scan.move(T)
    _, _, face = PartSurface(part).closest(aligned.points)
    normals = part.face_normals[face]
    order = np.argsort(aligned.points[:, 0], kind="stable")
    return part, replace(aligned, normals=normals).take(order).move(np.linalg.inv(T))


@pytest.mark.slow
@pytest.mark.parametrize(
    "kind", ["random", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("right", "flipped", "views"))]
)
def test_the_pose_does_not_depend_on_signs(outward: tuple[Part, Scan], kind: str) -> None:
    part, scan = outward
    assert scan.normals is not None
    signs = make_signs(kind, len(scan.points))
    pose = Register().run(replace(scan, normals=scan.normals * signs[:, None]), part, 4 * scan.noise)
    assert error(part, pose.T_part_scan, scan) < 0.5
    told = [note for note in pose.notes if "scan's normals point" in note]
    assert len(told) == (kind != "right")
    if told:
        share = {"flipped": (95, 100), "random": (45, 55), "views": (35, 65)}[kind]
        assert share[0] <= int(told[0].split(" at ")[1].split("%")[0]) <= share[1]
    assert not pose.doubts


@pytest.mark.slow
def test_a_run_with_flipped_normals_finds_the_damage_alone() -> None:
    part, scan = scene("block", seed=3, clutter=0.0, points=25_000)
    assert scan.truth is not None
    aligned = scan.move(scan.truth.T_part_scan)
    _, _, face = PartSurface(part).closest(aligned.points)
    points, normals = aligned.points.copy(), part.face_normals[face]
    deep = np.clip(1 - np.linalg.norm(points[:, :2] - [-20, -26], axis=1) / 6, 0, None) * 2
    points[:, 2] -= np.where(normals[:, 2] > 0.9, deep, 0.0)
    flipped = Scan(points, -normals).move(np.linalg.inv(scan.truth.T_part_scan))
    result = damageest.run({"version": 1, "tolerance": 0.25, "allowance": "none"}, part=part, scan=flipped)
    assert len(result.sites) == 1
    assert not result.surplus
    assert any("scan's normals point" in note.text for note in result.warnings)


def test_a_scanner_position_vouches_for_normals() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(1000, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    seen = points[points[:, 2] > 0.1]
    view = np.zeros(len(seen), np.int32)
    scan = Scan(seen, seen, viewpoints=np.array([[0, 0, 50.0]]), view=view)
    assert SignedNormals.read(scan).is_proven
    flipped = SignedNormals.read(replace(scan, normals=-seen))
    assert not flipped.is_proven
    assert flipped.normals is not None
    assert np.einsum("ij,ij->i", flipped.normals, seen)[seen[:, 2] > 0.3].min() > 0
    assert not SignedNormals.read(Scan(seen, seen)).is_proven
    assert not SignedNormals.read(replace(scan, view=view - 1)).is_proven
