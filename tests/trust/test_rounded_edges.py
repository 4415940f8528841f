"""A site along nearly all sharp edges is told from a broken end, from chips and from wear of whole faces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import INTACT, Deviation, Mesh, Scan
from damageest.geometry.make_part import make_part
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.scan_field import ScanField
from damageest.geometry.solids import to_arrays, to_solid
from damageest.trust.doubts.rounded_edges import ALL, measure_edges

SIZE = np.array([40.0, 30.0, 20.0])
BLOCK = Manifold.cube(SIZE, center=True)
PART = make_part(*to_arrays(BLOCK), "mm")


def chamfer(width: float) -> Manifold:
    """The block without its edges."""
    cut = BLOCK
    for k in range(3):
        for i in (-1.0, 1.0):
            for j in (-1.0, 1.0):
                normal = np.insert([i, j], k, 0.0) / np.sqrt(2)
                corner = np.insert([i, j], k, 0.0) * SIZE / 2
                cut = cut.trim_by_plane(tuple(-normal), float(-corner @ normal + width / np.sqrt(2)))
    return cut


def measure(left: Manifold) -> float:
    mesh = Mesh(*to_arrays(left.refine_to_length(0.6)))
    points, _ = sample_by_area(mesh, 8000, np.random.default_rng(0))
    nothing = np.zeros(len(points))
    deviation = Deviation(nothing, nothing.astype(np.int64), np.full(len(points), INTACT, np.uint8))
    field = ScanField(PART, Scan(points, noise=0.01, spacing=0.8), deviation, 0.2)
    damage: Any = to_solid(BLOCK - left)
    return measure_edges(damage, field)


@pytest.mark.parametrize("width", [0.5, 1.5])
def test_a_site_along_all_edges_is_found(width: float) -> None:
    assert measure(chamfer(width)) > 0.95


@pytest.mark.parametrize(
    "left",
    [
        BLOCK.trim_by_plane((-1, 0, 0), -12),
        BLOCK.trim_by_plane((-0.7, -0.7, 0), -16),
        Manifold.cube(SIZE - 0.6, center=True),
        BLOCK - Manifold.cube([39, 29, 0.8], center=True).translate([0, 0, 10]),
        BLOCK - Manifold.sphere(9, 48).translate([20, 15, 10]),
    ],
    ids=["broken end", "broken edge", "worn all over", "worn face", "chip"],
)
def test_other_losses_are_not(left: Manifold) -> None:
    assert measure(left) < ALL
