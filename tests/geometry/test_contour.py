"""Solids from a distance function, against a ball and a box."""

from __future__ import annotations

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import Flags, Floats
from damageest.errors import StageError
from damageest.geometry.contour import MOST_NODES, extract_contour, fit_contour
from damageest.geometry.solids import to_manifold
from tests.geometry.shapes import FAR

RADIUS, CELL = 5.0, 0.4
SHAPE = (32, 32, 32)


class Ball:
    """Signed distance to a ball about ``at``, which counts the points that it is asked for."""

    def __init__(self, at: Floats) -> None:
        self.at, self.count = at, 0

    def __call__(self, points: Floats) -> Floats:
        self.count += len(points)
        return np.asarray(np.linalg.norm(points - self.at, axis=1) - RADIUS)


@pytest.mark.parametrize("away", [np.zeros(3), FAR])
def test_a_ball_has_its_radius_and_few_nodes_are_evaluated(away: Floats) -> None:
    distance = Ball(away + 0.1)
    solid = extract_contour(distance, away - 6.2, SHAPE, CELL)
    radius = np.linalg.norm(solid.vertices - away - 0.1, axis=1)
    assert np.abs(radius - RADIUS).max() < 0.05 * CELL
    assert solid.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=0.01)
    assert distance.count < 0.8 * np.prod(SHAPE)


def test_the_walls_of_the_grid_close_what_reaches_them() -> None:
    solid = extract_contour(lambda points: points[:, 2] - 3.0, np.zeros(3), (20, 20, 20), 0.5)
    assert solid.bounds[1, 2] == pytest.approx(3.0, abs=0.01)
    assert solid.bounds[:, :2] == pytest.approx(np.array([[0, 0], [9.5, 9.5]]), abs=0.5)


def test_a_grid_too_large_is_refused_with_a_cell_that_fits() -> None:
    count = int(MOST_NODES ** (1 / 3)) + 10
    with pytest.raises(StageError, match="does not fit in memory") as caught:
        extract_contour(Ball(np.zeros(3)), np.zeros(3), (count, count, count), CELL)
    assert float(caught.value.remedy.split()[3]) > CELL


def test_nothing_inside_is_refused() -> None:
    with pytest.raises(StageError, match="empty"):
        extract_contour(Ball(np.full(3, 100.0)), np.zeros(3), (12, 12, 12), CELL)


def test_a_rough_contour_is_fitted_to_the_distance_also_at_creases() -> None:
    """Of two points: two balls, which meet in a crease; above z = 1 it is of no interest."""
    places = np.array([[-2.0, 0, 0], [2.0, 0, 0]])

    def closest(points: Floats) -> tuple[Floats, Floats]:
        away = np.linalg.norm(points[:, None] - places, axis=2)
        return away.min(axis=1), places[away.argmin(axis=1)]

    def matters(points: Floats, radius: float) -> Flags:
        return points[:, 2] < 1 + radius

    def measure(points: Floats) -> Floats:
        return closest(points)[0] - 3

    rough = extract_contour(measure, np.full(3, -6.17), (26, 26, 26), 0.5, matters)
    fine = fit_contour(rough, closest, 3.0, 0.02, matters)
    below = np.concatenate([fine.vertices, fine.triangles.mean(axis=1)])
    below = below[below[:, 2] < 1]
    off = np.abs(measure(below))
    assert np.quantile(off, 0.99) <= 0.02
    assert off.max() <= 0.03  # after the last round
    middle = rough.triangles.mean(axis=1)
    assert np.abs(measure(middle[middle[:, 2] < 1])).max() > 0.06
    half = to_manifold(fine) ^ Manifold.cube((20, 20, 20), True).translate((0, 0, -10))
    balls = Manifold.sphere(3, 256).translate((-2, 0, 0)) + Manifold.sphere(3, 256).translate((2, 0, 0))
    assert half.volume() == pytest.approx(balls.volume() / 2, rel=0.012)
