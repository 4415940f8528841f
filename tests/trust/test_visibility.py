"""From where an inner surface could be seen: the right side of a thin wall can, what is left of it cannot."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import DAMAGE, INTACT, Deviation, Scan, Solid
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.trust.doubts.not_visible import Visibility, measure_visibility
from tests.stages.enclose.test_side import RADIUS, TOLERANCE, plate, scan_top


def ask(wall: float, deep: float, wrong: bool, rim: bool = True) -> Visibility:
    """Of a pit in a plate whose top alone is scanned; ``wrong``: the metal below the pit is taken for the lost one."""
    part, points = plate(wall), scan_top(deep)
    distance = signed_distance(points, part)[0]
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    members = points[label == DAMAGE]
    ball = trimesh.creation.icosphere(5, (RADIUS**2 + deep**2) / (2 * deep))
    ball.apply_translation([0, 0, (RADIUS**2 - deep**2) / (2 * deep)])
    box, column = trimesh.Trimesh(part.vertices, part.faces), trimesh.creation.cylinder(RADIUS, 99, sections=96)
    if wrong:
        ball = trimesh.boolean.difference([column, ball], engine="manifold")
    lost = trimesh.boolean.intersection([box, ball], engine="manifold")
    if not rim:
        label[:] = DAMAGE
    deviation = Deviation(distance, closest_on_mesh(points, part).face, label)
    scan = Scan(points, noise=0.02, spacing=0.8)
    field = ScanField(part, scan, deviation, TOLERANCE)
    return measure_visibility(Solid(lost.vertices, lost.faces), field, members)


@pytest.mark.parametrize(("wall", "deep"), [(3.0, 1.2), (3.0, 2.4), (2.0, 0.8), (30.0, 1.2)])
def test_the_floor_of_a_pit_is_seen_from_where_the_skin_was(wall: float, deep: float) -> None:
    found = ask(wall, deep, wrong=False)
    assert found.shut + found.turned < 0.05


@pytest.mark.parametrize(("wall", "deep"), [(3.0, 1.2), (3.0, 2.4), (2.0, 0.8), (30.0, 1.2)])
def test_the_metal_below_it_is_not_what_is_lost(wall: float, deep: float) -> None:
    assert ask(wall, deep, wrong=True).turned > 0.9


def test_a_hollow_inside_the_metal_is_seen_from_nowhere() -> None:
    part = plate(30.0)
    hollow = trimesh.creation.icosphere(4, 6.0)
    hollow.apply_translation([0, 0, -15])
    lid = trimesh.creation.cylinder(0.2, 12, sections=16)
    lid.apply_translation([0, 0, -5])
    lost = trimesh.boolean.union([hollow, lid], engine="manifold")
    lost = trimesh.boolean.intersection([lost, trimesh.Trimesh(part.vertices, part.faces)], engine="manifold")
    points = np.concatenate([scan_top(0.01), np.asarray(hollow.vertices)])
    distance = signed_distance(points, part)[0]
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    deviation = Deviation(distance, closest_on_mesh(points, part).face, label)
    members = np.concatenate([np.asarray(hollow.vertices), [[0, 0, -1.0], [0, 0, -0.1]]])
    scan = Scan(points, noise=0.02, spacing=0.8)
    field = ScanField(part, scan, deviation, TOLERANCE)
    found = measure_visibility(Solid(lost.vertices, lost.faces), field, members)
    assert found.shut > 0.7


def test_without_skin_beside_it_nothing_is_said() -> None:
    assert ask(3.0, 1.2, wrong=True, rim=False) == Visibility()
