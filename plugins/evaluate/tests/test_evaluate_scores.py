from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from damageest_benchmarks.parts import PARTS
from damageest_evaluate.scores import iou, score

from damageest.artefacts import Floats, Solid
from damageest.geometry.skin import extract_ids


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Solid:
    mesh = trimesh.creation.box(bounds=(low, high))
    return Solid(mesh.vertices, mesh.faces)


def turned(degrees: float) -> Floats:
    return np.asarray(trimesh.transformations.rotation_matrix(math.radians(degrees), (0, 0, 1)))


def test_iou_of_boxes() -> None:
    a, b = box((0, 0, 0), (2, 1, 1)), box((1, 0, 0), (3, 1, 1))
    assert iou([a], [b]) == pytest.approx(1 / 3)
    assert iou([a], [a]) == pytest.approx(1)
    assert iou([a], [box((5, 0, 0), (6, 1, 1))]) == 0
    assert iou([], []) == 1
    assert iou([a], []) == iou([], [a]) == 0


def test_many_solids_count_as_their_union() -> None:
    halves = [box((0, 0, 0), (1.2, 1, 1)), box((0.8, 0, 0), (2, 1, 1))]
    assert iou(halves, [box((0, 0, 0), (2, 1, 1))]) == pytest.approx(1)


def test_score_of_a_cut_that_is_too_shallow() -> None:
    part = PARTS["cuboid"]()  # 70 x 50 x 30
    true, found = box((25, -25, -15), (35, 25, 15)), box((26, -25, -15), (35, 25, 15))
    result = score(part, [found], true, 0.5)
    assert result.iou == pytest.approx(0.9)
    assert result.volume_error == pytest.approx(-0.1)
    assert extract_ids(true, part).area == pytest.approx(50 * 30)
    assert result.surface_error == pytest.approx(1 / 0.5)
    assert math.isnan(result.pose_error)


def test_nothing_found_and_nothing_there() -> None:
    part = PARTS["cuboid"]()
    piece = box((25, -25, -15), (35, 25, 15))
    assert score(part, [], None, 0.1).iou == 1
    assert score(part, [piece], None, 0.1).iou == 0
    assert score(part, [], piece, 0.1).iou == 0
    assert score(part, [], piece, 0.1).volume_error == -1


def test_a_pose_that_the_symmetry_allows_is_right() -> None:
    part = PARTS["cuboid"]()
    true, mirrored = box((25, -25, -15), (35, 0, 15)), box((-35, 0, -15), (-25, 25, 15))
    result = score(part, [mirrored], true, 0.2, turned(180), np.eye(4))
    assert result.pose_error == pytest.approx(0, abs=1e-9)
    assert result.iou == pytest.approx(1)
    # the same damage found without that turn of the pose is at the wrong end
    assert score(part, [mirrored], true, 0.2, np.eye(4), np.eye(4)).iou == 0


def test_a_wrong_pose_is_wrong() -> None:
    part = PARTS["cuboid"]()
    true = box((25, -25, -15), (35, 0, 15))
    quarter = score(part, [true], true, 0.2, turned(90), np.eye(4))
    assert quarter.pose_error > 1
    shifted = np.eye(4)
    shifted[0, 3] = 0.1
    assert score(part, [true], true, 0.2, shifted, np.eye(4)).pose_error == pytest.approx(
        0.1 * math.sqrt(2 * 50 * 30 / part.area), rel=0.1
    )


def test_distances_between_the_inner_surfaces_leave_the_skin_out() -> None:
    part = PARTS["cuboid"]()  # 70 x 50 x 30
    true, found = box((25, -25, -15), (35, 25, 15)), box((26, -25, -15), (35, 25, 15))
    result = score(part, [found], true, 0.5)
    # two parallel faces one apart; the skin, which both share, would bring the median to 0
    assert (result.distance_median, result.distance_95, result.distance_max) == pytest.approx((1, 1, 1))
    corner = box((25, 0, 0), (35, 25, 15))
    result = score(part, [corner], true, 0.05)
    assert result.distance_median < result.distance_95 < result.distance_max
    # the true corner at (25, -25, -15) is 25 off the found one's near edge, at y = 0, and 15 off its z = 0
    assert result.distance_max == pytest.approx(math.hypot(25, 15), rel=0.03)


def test_what_is_shallower_than_the_tolerance_does_not_count_as_apart() -> None:
    part = PARTS["cuboid"]()
    true = box((25, -25, -15), (35, 25, 15))
    # beside the same cut, a sliver of 0.2 off the top
    sliver = box((0, -25, 14.8), (25, 25, 15))
    assert score(part, [true, sliver], true, 0.5).distance_max == pytest.approx(0, abs=1e-9)
    assert score(part, [true, sliver], true, 0.1).distance_max == pytest.approx(25, rel=0.03)


def test_losses_found_and_missed_and_false_sites() -> None:
    part = PARTS["cuboid"]()
    west, east = box((-35, -25, -15), (-30, 25, 15)), box((30, -25, -15), (35, 25, 15))
    both = Solid(np.concatenate([west.vertices, east.vertices]), np.concatenate([west.faces, east.faces + 8]))
    half, elsewhere = box((30, -25, -15), (35, 0, 15)), box((-5, 20, -15), (5, 25, 15))
    result = score(part, [half, elsewhere], both, 0.5)
    assert (result.found, result.missed, result.false_sites) == (1, 1, 1)
    # one site over both losses finds both; a loss within the tolerance is none
    assert score(part, [box((-35, -25, -15), (35, 25, 15))], both, 0.5).found == 2
    thin = box((34.8, -25, -15), (35, 25, 15))
    assert score(part, [], thin, 0.5).missed == 0
    assert score(part, [], thin, 0.1).missed == 1
    nothing = score(part, [half], None, 0.5)
    assert (nothing.found, nothing.missed, nothing.false_sites) == (0, 0, 1)
