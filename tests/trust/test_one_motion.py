"""A view that is shifted as a whole explains a site; wear, chips and broken ends have another shape."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import DAMAGE, INTACT, Deviation, Floats, Part, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.stages.scan.simulate import Simulate
from damageest.trust.doubts.one_motion import are_sound, is_one_motion
from tests.damaged_box import SIZE, box

TOLERANCE, NOISE = 0.2, 0.05
TOP = SIZE[2] / 2


def scan_box(*tools: dict[str, object]) -> Floats:
    scanner = Simulate.model_validate({"damage": list(tools), "points": 20_000, "noise": NOISE, "seed": 1})
    return np.array(scanner.run("mm", box()).points)


def ask(points: Floats) -> bool:
    distance, face = signed_distance(points, box())
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    scan = Scan(points, noise=NOISE, spacing=0.6)
    members = np.flatnonzero(label == DAMAGE)
    return is_one_motion(ScanField(box(), scan, Deviation(distance, face, label), TOLERANCE), members)


@pytest.mark.parametrize("shift", [1.5, 3.0])
def test_a_shifted_view_is_found(shift: float) -> None:
    points = scan_box()
    own = (points / np.array(SIZE)).sum(axis=1) > 0.4
    points[own] -= shift * TOLERANCE
    assert ask(points)


@pytest.mark.parametrize(
    "tool",
    [
        {"tool": "box", "centre": [0, 0, TOP], "size": [100, 100, 1.2]},
        {"tool": "box", "centre": [SIZE[0] / 2, 0, TOP], "size": [6, 100, 6]},
        {"tool": "plane", "point": [SIZE[0] / 2 - 8, 0, TOP], "normal": [1, 0, 1]},
        {"tool": "sphere", "centre": [SIZE[0] / 2, 0, TOP], "radius": 7},
    ],
    ids=["one face", "step", "chamfer", "ball"],
)
def test_losses_are_no_motion(tool: dict[str, object]) -> None:
    assert not ask(scan_box(tool))


def test_a_journal_that_is_worn_on_one_side_is_no_motion() -> None:
    mesh = trimesh.creation.cylinder(10, 40, sections=180)
    part = Part(mesh.vertices, mesh.faces)
    points, index = trimesh.sample.sample_surface(mesh, 20_000, seed=1)
    worn = (points[:, 0] > 0) & (np.abs(mesh.face_normals[index][:, 2]) < 0.5)
    points = points + np.random.default_rng(1).normal(scale=NOISE, size=points.shape)
    points[worn] -= [0.8, 0, 0]
    distance, face = signed_distance(points, part)
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    scan, members = Scan(points, noise=NOISE, spacing=0.6), np.flatnonzero(label == DAMAGE)
    assert not is_one_motion(ScanField(part, scan, Deviation(distance, face, label), TOLERANCE), members)


def test_wear_of_all_faces_is_no_motion() -> None:
    part, points = box(), scan_box()
    normals = part.face_normals[signed_distance(points, part)[1]]
    assert not ask(points - 2 * TOLERANCE * normals)


@pytest.mark.parametrize(("off", "sound"), [(0.0, True), (1.5, False)])
def test_datums_are_sound_where_the_scan_lies_on_them(off: float, sound: bool) -> None:
    """What all other skin has in common is then its wear."""
    on = np.arange(1000) < 300
    distance = np.where(on, -off, -3.0) + 0.1 * np.random.default_rng(0).normal(size=1000)
    assert are_sound(distance, on, 1.0) == sound
    assert not are_sound(distance, on & (np.arange(1000) < 20), 1.0)  # too few to hold anything
