"""The surface at the clearance from the part, for any part."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_benchmarks.parts import PARTS

from damageest.artefacts import Mesh
from damageest.geometry.distance import signed_distance
from damageest.stages.background.minkowski import Minkowski
from tests.stages.background.holding import box, dent, measure_gap


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tube", *(pytest.param(name, marks=pytest.mark.slow) for name in ("grille", "gear"))])
def test_everywhere_at_the_clearance(name: str) -> None:
    part = PARTS[name]()
    tolerance = 0.004 * part.diagonal
    inside = Mesh(part.vertices[:3] * 0.99, np.array([[0, 1, 2]]))
    found = Minkowski().run(part, inside, tolerance, 0.1 * tolerance, False)
    distance, _ = signed_distance(found.triangles.mean(axis=1)[::5], part)
    assert np.median(distance) == pytest.approx(2 * tolerance, rel=0.12)
    assert distance.min() > 1.3 * tolerance
    assert distance.max() < 3.1 * tolerance
    assert measure_gap(found, part, inside)[1]


def test_volume_is_steiners() -> None:
    """Of a box moved outward by r: V + A r + pi r^2 (a + b + c) + 4/3 pi r^3."""
    a, b, c, r = 40.0, 30.0, 20.0, 4.0
    found = Minkowski(clearance=8).run(box((a, b, c)), dent(9), 0.5, 0.1, False)
    true = a * b * c + 2 * (a * b + b * c + c * a) * r + np.pi * r**2 * (a + b + c) + 4 / 3 * np.pi * r**3
    assert found.volume == pytest.approx(true, rel=0.05)


def test_same_in_a_far_corner_of_space() -> None:
    here = Minkowski().run(box(), dent(), 0.5, 0.1, False)
    away = (3e5, -2e5, 1e5)
    there = Minkowski().run(box(away=away), dent(away=away), 0.5, 0.1, False)
    assert there.volume == pytest.approx(here.volume, rel=1e-3)


@pytest.mark.slow
def test_bounded_however_small_the_tolerance() -> None:
    assert len(Minkowski().run(box(), dent(9), 1e-3, 1e-3, True).faces) < 800_000
