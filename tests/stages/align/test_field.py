"""The grid of planes about a part, against exact distances."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from damageest.artefacts import Mesh
from damageest.geometry.distance import signed_distance
from damageest.stages.align.surface.plane_grid import NEAR, PartSurface
from damageest.stages.align.symmetry.prepare_part import prepare_part


@pytest.mark.variants(1)
@pytest.mark.parametrize(
    "body",
    [
        trimesh.creation.box((4, 3, 2)),
        trimesh.creation.annulus(1.5, 2.0, 3.0, sections=90),
        trimesh.creation.torus(2.0, 0.4),
    ],
)
def test_the_grid_is_exact_near_the_skin_and_on_the_right_side_elsewhere(body: trimesh.Trimesh) -> None:
    low, high = body.bounds
    size = float(np.linalg.norm(high - low))
    mesh = Mesh((np.asarray(body.vertices) - (low + high) / 2) / size, np.asarray(body.faces))
    grid = prepare_part(PartSurface(mesh), 0).grid
    number = np.random.default_rng(0).choice(len(grid.distance), 20_000, replace=False)
    at = np.stack(np.unravel_index(number, grid.shape), axis=1)
    centres = grid.low.astype(np.float64) + (at + 0.5) * grid.cell
    exact, found = signed_distance(centres, mesh)[0], grid.distance[number].astype(np.float64)
    near = np.abs(exact) < NEAR - 0.015
    assert near.sum() > 1000
    np.testing.assert_allclose(np.abs(found[near]), np.abs(exact[near]), atol=1e-5)
    np.testing.assert_allclose(np.abs(found), np.abs(exact), atol=0.02)
    assert (np.sign(found) != np.sign(exact)).mean() < 2e-3
