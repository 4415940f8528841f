"""The complement of a part: a box with the part as its cavity, and a scan seen from it."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.artefacts import ADDED, DAMAGE, INTACT, OUTLIER, Deviation, Samples, Sites
from damageest.geometry.complement import complement_deviation, complement_part, complement_samples, label_strays
from damageest.geometry.distance import signed_distance
from tests.damaged_box import SIZE, box


def test_the_box_has_the_part_as_its_cavity_and_the_margin_on_every_side() -> None:
    points = np.array([[50.0, 0.0, 0.0]])
    space = complement_part(box(), points, 5.0)
    assert space.bounds.tolist() == [[-25.0, -20.0, -15.0], [55.0, 20.0, 15.0]]
    assert space.volume == pytest.approx(80 * 40 * 30 - np.prod(SIZE))
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 12.0], [30.0, 0.0, 0.0]])
    assert (np.sign(signed_distance(places, space)[0]) == [1, -1, -1]).all()


def test_distances_labels_and_normals_are_turned() -> None:
    deviation = Deviation(
        np.array([0.1, -2.0, 3.0]), np.zeros(3, np.int64), np.array([INTACT, DAMAGE, ADDED], np.uint8)
    )
    turned = complement_deviation(deviation)
    assert turned.distance.tolist() == [-0.1, 2.0, -3.0]
    assert turned.label.tolist() == [INTACT, ADDED, DAMAGE]
    normals = np.array([[0.0, 0.0, 1.0]])
    samples = Samples(np.zeros((1, 3)), normals, np.zeros(1, np.int64), np.zeros(1, np.uint8), 1.0)
    assert complement_samples(samples).normals.tolist() == [[0, 0, -1]]


def test_points_in_no_kept_cluster_become_outliers() -> None:
    deviation = Deviation(np.ones(3), np.zeros(3, np.int64), np.array([ADDED, ADDED, DAMAGE], np.uint8))
    kept = Sites(np.array([1, 0, 0], np.int32), 1)
    assert label_strays(deviation, ADDED, kept).label.tolist() == [ADDED, OUTLIER, DAMAGE]
