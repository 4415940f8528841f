"""The first layer on the floor, and beads that reach it where there is air."""

from __future__ import annotations

import numpy as np
import pytest
from damageest_paths.foot import measure_air
from damageest_paths.layering.anchor import find_foot
from manifold3d import Manifold

from tests.path_shapes import BLOCK, cut, plan


def test_a_spike_of_the_floor_does_not_lift_the_layers() -> None:
    """A floor at 0 with a thin spike 0.4 deep: the first layer lies on the floor."""
    body = Manifold.cube((12, 8, 3)) + Manifold.cube((0.3, 0.3, 0.5)).translate((5, 4, -0.4))
    assert body.bounding_box()[2] == pytest.approx(-0.4)
    assert find_foot(body, 2.0, 1.0) == pytest.approx(0.0, abs=1e-6)


def test_the_foot_is_no_more_than_a_layer_above_the_deepest_place() -> None:
    body = Manifold.cube((12, 8, 3)) + Manifold.cube((0.5, 8, 4)).translate((5, 0, -4))
    assert find_foot(body, 2.0, 1.0) == pytest.approx(-3.0, abs=1e-6)


def test_beads_over_a_leaning_floor_reach_it() -> None:
    """A wedge-shaped cavity: planes leave up to half a layer of air over its floor, and beads there are higher."""
    wedge = Manifold.cube((20, 10, 8)).translate((-10, -5, 0)).rotate((0, 12, 0)).translate((0, 0, -3))
    loss = cut(BLOCK, wedge ^ BLOCK)
    path = plan(loss, direction=(0.0, 0.0, 1.0), axes=3)
    air = measure_air(path, loss.left)[path.on]
    more = (path.sizes - path.planned_sizes)[path.on, 1]
    height = path.heights[0]
    assert more.max() > 0.2 * height
    assert np.quantile(air - more, 0.95) < 0.1 * height
    assert path.feed[path.on].min() < 600
