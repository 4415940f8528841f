"""Thin walls seen from one side: the metal is lost on the side of the skin that the scan shows, at any depth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import damageest
from damageest.artefacts import DAMAGE, INTACT, Deviation, Part, Scan
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.io.meshes import write_points
from damageest.registry import Registry
from damageest.stages.enclose._side import find_behind
from damageest.stages.enclose._skin import DamagedPoints, SkinSamples

TOLERANCE, RADIUS = 0.15, 9.0
"""The pit is a cap of a ball, without an edge at its rim."""


def cap_volume(deep: float) -> float:
    return float(np.pi * deep * (3 * RADIUS**2 + deep**2) / 6)


def plate(wall: float) -> Part:
    box = trimesh.creation.box((60, 60, wall))
    box.apply_translation([0, 0, -wall / 2])
    return Part(box.vertices, box.faces)


def scan_top(deep: float, spacing: float = 0.8, noise: float = 0.02) -> np.ndarray:
    """Points (N,3) of the top, z = 0, with a pit in its middle that is ``deep``; nothing of the other sides."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-29.5, 29.5, (int((60 / spacing) ** 2), 3))
    ball = (RADIUS**2 + deep**2) / (2 * deep)
    off = np.hypot(points[:, 0], points[:, 1])
    points[:, 2] = -np.where(off < RADIUS, np.sqrt(np.maximum(ball**2 - off**2, 0)) - (ball - deep), 0)
    points[:, 2] += rng.normal(0, noise, len(points))
    return points


def ask_behind(part: Part, points: np.ndarray, skin: np.ndarray, rim: bool = True) -> np.ndarray:
    """Which of the samples of the skin (S,3) are behind, as if no point showed them."""
    distance, label = signed_distance(points, part)[0], np.zeros(len(points), np.uint8)
    label[:] = np.where(distance < -TOLERANCE, DAMAGE, INTACT)
    found = closest_on_mesh(skin, part).face
    samples = SkinSamples(
        skin, part.face_normals[found], np.ones(len(skin), bool), np.zeros(len(skin)), np.ones(len(skin))
    )
    damaged = np.flatnonzero(label == DAMAGE)
    scan, deviation = (
        Scan(points, noise=0.02, spacing=0.8),
        Deviation(distance, closest_on_mesh(points, part).face, label),
    )
    grown = np.zeros(len(points), bool) if rim else label == INTACT
    own = DamagedPoints(points[damaged], np.ones(len(damaged), int), damaged, grown)
    return find_behind(ScanField(part, scan, deviation, TOLERANCE), own, samples)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize(("wall", "deep"), [(3.0, 1.2), (3.0, 2.4), (1.5, 0.9)])
def test_the_far_skin_is_behind_and_the_lost_one_is_not(wall: float, deep: float, turned: bool) -> None:
    part, points = plate(wall), scan_top(deep)
    rng = np.random.default_rng(0)
    flat = np.concatenate([rng.uniform(-8, 8, (400, 2)), np.zeros((400, 1))], axis=1)
    near, far = flat[np.hypot(flat[:, 0], flat[:, 1]) < 8], flat - [0, 0, wall]
    if turned:  # nothing depends on where up is
        turn = trimesh.transformations.rotation_matrix(2.0, [1, 2, 3])[:3, :3]
        part = Part(part.vertices @ turn.T, part.faces)
        points, near, far = (at @ turn.T for at in (points, near, far))
    assert not ask_behind(part, points, near).any()
    assert ask_behind(part, points, far).mean() > 0.95, "a few places lie beside the nearest point"
    assert not ask_behind(part, points, far, rim=False).any(), "without a rim nothing shows the side"


def test_the_far_skin_is_behind_what_a_deep_pit_leaves_of_a_thick_wall() -> None:
    rng = np.random.default_rng(0)
    far = np.concatenate([rng.uniform(-2, 2, (400, 2)), np.full((400, 1), -6.0)], axis=1)
    assert ask_behind(plate(6.0), scan_top(5.0), far).mean() > 0.95, "1 of 6 mm is left, a little more than a spacing"


def test_skin_below_a_thick_wall_and_little_skin_are_never_behind() -> None:
    points = scan_top(1.2)
    flat = points * [1, 1, 0]
    assert not ask_behind(plate(30.0), points, flat[:400] - [0, 0, 30]).any()
    few = np.concatenate([flat[:2000], flat[:40] - [0, 0, 3]])
    assert not ask_behind(plate(3.0), points, few).any(), "these are not enough to be the far skin of a wall"


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.02, 0.04])
@pytest.mark.parametrize(("wall", "deep"), [(3.0, 1.2), (3.0, 2.0), (2.0, 0.8)])
def test_a_pit_in_a_plate_seen_from_one_side_is_right_or_doubted(
    wall: float, deep: float, noise: float, tmp_path: Path, registry: Registry
) -> None:
    part = plate(wall)
    trimesh.Trimesh(part.vertices, part.faces).export(tmp_path / "plate.stl")
    x, y, z = scan_top(deep, 0.6, noise).T
    write_points(tmp_path / "scan.ply", {"x": x, "y": y, "z": z})
    (tmp_path / "job.yaml").write_text(
        f"version: 1\ntolerance: {TOLERANCE}\npart: plate.stl\nscan: scan.ply\nalign: none\nreport: none\n"
    )
    result = damageest.run(tmp_path / "job.yaml", registry=registry, output=False, settings=["accept=all"])
    low, high = result.volume_95 or (0.0, 0.0)
    assert low <= cap_volume(deep) <= high
    taken = sum(site.damage.volume for site in result.sites if site.verdict.level != "doubtful")
    assert taken == 0 or taken == pytest.approx(cap_volume(deep), rel=0.15)
