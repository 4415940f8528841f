"""The field of a scan: distance, foot and normal of each point, computed in one way."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import INTACT, Scan
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.scan_field import ScanField
from tests.damaged_box import SIZE, box

TOP = SIZE[2] / 2


def make_field() -> ScanField:
    """200 points over the top of a box, up to 0.5 inside and outside of it."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (200, 3)) + np.array([0, 0, TOP])
    return ScanField.measure(box(), Scan(points), 0.2)


def test_a_measured_field_has_distances_and_no_labels() -> None:
    field = make_field()
    assert np.allclose(field.distance, field.points[:, 2] - TOP)
    assert (field.label == INTACT).all()
    assert np.array_equal(field.intact, field.points)


def test_feet_lie_on_the_skin_straight_below_the_points() -> None:
    field = make_field()
    assert np.allclose(field.feet, closest_on_mesh(field.points, field.part).place)
    some = np.array([3, 150, 7])
    assert np.array_equal(field.find_feet(some), field.feet[some]), "for some points as for all, to the last bit"
    assert np.array_equal(field.find_feet(field.distance > 0), field.feet[field.distance > 0])
    assert np.allclose(field.find_normals(some), [0, 0, 1])


def test_feet_are_computed_once_and_leave_the_scan_as_it_was() -> None:
    field = make_field()
    before = field.points.copy(), field.part.face_normals.copy()
    assert field.feet is field.feet
    assert np.array_equal(field.points, before[0])
    assert np.array_equal(field.part.face_normals, before[1])
