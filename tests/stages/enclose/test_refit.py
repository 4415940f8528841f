"""A closed region moved onto the points of the damage surface."""

from __future__ import annotations

import numpy as np
import trimesh

from damageest.artefacts import Solid
from damageest.stages.enclose._refit import refit_region


def test_a_mesh_comes_onto_its_points_and_stays_closed() -> None:
    true = trimesh.creation.icosphere(5, 6.0)
    wavy = true.vertices * (1 + 0.01 * np.sin(3 * true.vertices[:, :1]))
    region = Solid(wavy, true.faces)
    points = trimesh.creation.icosphere(4, 6.0).vertices
    half = points[points[:, 2] > 0]
    fitted = refit_region(region, half, -half / 6, 0.2)
    radius = np.linalg.norm(fitted.vertices, axis=1)
    above, below = true.vertices[:, 2] > 0.6, true.vertices[:, 2] < -0.8
    assert np.abs(radius[above] - 6).max() < 0.006
    assert np.array_equal(fitted.vertices[below], region.vertices[below])
