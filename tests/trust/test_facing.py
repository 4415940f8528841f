"""Points within the tolerance of the skin that lie on another surface, on losses with known truth."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold

from damageest.artefacts import DAMAGE, INTACT, Deviation, Flags, Floats, Part, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.scan_field import ScanField
from damageest.geometry.solids import to_arrays
from damageest.trust.skin.facing import find_turned

TOLERANCE = 0.5


def make_plate(length: float) -> Any:
    return Manifold.cube((length, 20, 4))


def make_wall(length: float) -> Any:
    return Manifold.cube((length, 0.8, 6)).translate((0, 9.6, 4))


def find(nominal: Any, damaged: Any, spacing: float, noise: float) -> tuple[Flags, Floats]:
    """Which points of a virtual scan are found, and their places without noise (N,3)."""
    import trimesh

    vertices, faces = to_arrays(nominal)
    part = Part(vertices, faces)
    mesh = trimesh.Trimesh(*to_arrays(damaged), process=False)
    places = np.asarray(trimesh.sample.sample_surface(mesh, int(1.2 * mesh.area / spacing**2), seed=4)[0])
    points = places + np.random.default_rng(1).normal(0, noise, places.shape)
    distance, face = signed_distance(points, part)
    label = np.where(np.abs(distance) < TOLERANCE, INTACT, DAMAGE).astype(np.uint8)
    scan = Scan(points, noise=noise, spacing=spacing)
    return find_turned(ScanField(part, scan, Deviation(distance, face, label), TOLERANCE)), places


@pytest.mark.variants(1)
@pytest.mark.parametrize(("spacing", "noise", "length"), [(0.12, 0.06, 30), (0.04, 0.06, 10)])
def test_the_root_of_a_thin_wall_is_found(spacing: float, noise: float, length: float) -> None:
    found, places = find(make_plate(length) + make_wall(length), make_plate(length), spacing, noise)
    root = (np.abs(places[:, 1] - 10) < 0.25) & (places[:, 2] > 3.9)
    assert found[root].mean() > 0.65  # beside the wall the nearest skin may be the wall or the plate
    away = (np.abs(places[:, 1] - 10) > 1.5) | (places[:, 2] < 3.9)
    assert found[away].mean() < 1e-3


@pytest.mark.parametrize("spacing", [0.3, 0.12, 0.06])
def test_intact_skin_is_not_found(spacing: float) -> None:
    whole = make_plate(10) + make_wall(10)
    found, _ = find(whole, whole, spacing, 0.12)
    assert found.mean() < 1e-3
