"""The table under a part is told from faces of the part."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Floats
from damageest.geometry.tables import find_table

NEAR = 0.3


def scan_on_table(table: bool) -> Floats:
    """Points on a stepped body, and on the table around it."""
    rng = np.random.default_rng(0)
    body = [trimesh.creation.box((60, 40, 20)).apply_translation((0, 0, 10)),
            trimesh.creation.box((20, 20, 10)).apply_translation((5, 3, 25))]  # fmt: skip
    points = np.concatenate([trimesh.sample.sample_surface(one, 3000, seed=0)[0] for one in body])
    if table:
        flat = np.column_stack([rng.uniform(-80, 80, (6000, 2)), np.zeros(6000)])
        under = (np.abs(flat[:, 0]) < 30) & (np.abs(flat[:, 1]) < 20)
        points = np.concatenate([points, flat[~under]])
    return np.asarray(points + rng.normal(0, 0.02, points.shape))


@pytest.mark.parametrize("turn", [0.0, 70.0])
def test_a_table_is_found_with_its_side(turn: float) -> None:
    R = trimesh.transformations.rotation_matrix(np.radians(turn), (1, 2, 3))[:3, :3]
    points = scan_on_table(table=True) @ R.T + (100, -50, 20)
    table = find_table(points, NEAR)
    assert table is not None
    assert table.normal @ R[:, 2] > 0.9999
    on = table.find(points, NEAR)
    assert on[6000:].all()
    assert on[:6000].mean() < 0.35  # the underside of the body


def test_a_face_of_the_part_is_no_table() -> None:
    assert find_table(scan_on_table(table=False), NEAR) is None


def test_few_points_have_no_table() -> None:
    assert find_table(np.zeros((20, 3)), NEAR) is None
