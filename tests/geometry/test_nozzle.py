"""The tool that is shown stands on the bead, its nozzle one standoff above it, along the axis."""

from __future__ import annotations

import numpy as np
import pytest

from damageest.geometry.nozzle import place_tool
from damageest.geometry.solids import to_manifold
from damageest.geometry.vectors import normalise
from tests.path_shapes import dent, plan


@pytest.mark.variants(1)
@pytest.mark.parametrize("axis", [(0, 0, 1), (1, 0, 0), (0.3, -0.5, 0.7)])
def test_beam_and_nozzle_lie_along_the_axis(axis: tuple[float, float, float]) -> None:
    path, way = plan(dent()), normalise(np.array([axis], float))[0]
    point = np.array([4.0, -3.0, 2.0])
    nozzle, beam = place_tool(path, point, way)
    along = (beam.vertices - point) @ way
    assert along.min() == pytest.approx(0, abs=1e-9)
    assert along.max() == pytest.approx(path.standoff)
    aside = np.linalg.norm(beam.vertices - point - along[:, None] * way, axis=1)
    np.testing.assert_allclose(aside, path.width / 2)
    assert ((nozzle.vertices - point) @ way).min() == pytest.approx(path.standoff)
    assert to_manifold(nozzle).volume() > 0
