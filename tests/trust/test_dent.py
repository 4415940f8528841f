"""A dent and a pit in a wall of which one side was scanned: the dent fades out, the pit has an edge."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import DAMAGE, INTACT, Deviation, Floats, Scan, Solid
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.trust.doubts.dent import find_bent_wall
from damageest.trust.skin.coverage import SkinView
from damageest.trust.skin.skin_cells import cut_skin, find_seen
from tests.stages.enclose.test_side import RADIUS, TOLERANCE, plate, scan_top

SPACING = 0.8


def scan_dent(deep: float) -> Floats:
    """Points of the top, with a bell in its middle that is ``deep`` and half as deep at a radius of 6."""
    points = scan_top(1e-6)
    points[:, 2] -= deep * 2.0 ** -((np.hypot(points[:, 0], points[:, 1]) / 6) ** 2)
    return points


def ask(wall: float, points: Floats) -> float:
    part = plate(wall)
    distance = signed_distance(points, part)[0]
    label = np.where(distance < -TOLERANCE, DAMAGE, INTACT).astype(np.uint8)
    deviation = Deviation(distance, closest_on_mesh(points, part).face, label)
    scan = Scan(points, noise=0.02, spacing=SPACING)
    field = ScanField(part, scan, deviation, TOLERANCE)
    cells = cut_skin(part, SPACING)
    skin = SkinView(cells, *find_seen(cells, field), None)
    lost = trimesh.creation.cylinder(RADIUS, 1.0, sections=64)
    lost.apply_translation([0, 0, -0.5])
    members = np.flatnonzero(label == DAMAGE)
    return find_bent_wall(Solid(lost.vertices, lost.faces), skin, field, members)


@pytest.mark.parametrize("deep", [0.6, 0.9])
def test_a_dent_of_a_thin_wall_may_be_one(deep: float) -> None:
    assert ask(1.5, scan_dent(deep)) == pytest.approx(1.5, rel=1e-3)


@pytest.mark.parametrize("deep", [0.5, 0.9, 1.4])
def test_a_pit_ends_at_an_edge(deep: float) -> None:
    assert ask(1.5, scan_top(deep)) == 0


def test_a_thick_wall_has_no_dent() -> None:
    assert ask(12.0, scan_dent(0.9)) == 0


def test_the_other_side_tells_where_it_was_scanned() -> None:
    below = scan_top(1e-6)
    below[:, 2] = -1.5 + np.random.default_rng(4).normal(0, 0.02, len(below))
    assert ask(1.5, np.concatenate([scan_dent(0.6), below])) == 0
