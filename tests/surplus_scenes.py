"""Scans of a block with added metal of known shape, from everywhere, for the tests of surplus."""

from __future__ import annotations

from typing import Any

import numpy as np
from manifold3d import Manifold

from damageest.artefacts import Floats, Mesh, Part
from damageest.geometry.solids import to_arrays
from tests.scenes import spread

NOISE, TOLERANCE = 0.03, 0.15
TOP = 6.0
"""z of the block's top."""


def block() -> Any:
    return Manifold.cube((24, 18, 12), True)


def part() -> Part:
    return Part(*to_arrays(block()))


def ball(radius: float, x: float, y: float, z: float) -> Any:
    return Manifold.sphere(radius, 64).translate((x, y, z))


def slab(size: tuple[float, float, float], x: float, y: float, z: float) -> Any:
    return Manifold.cube(size, True).translate((x, y, z))


def scan(actual: Any, count: int = 16_000, seed: int = 3) -> Floats:
    """Points (count,3) all over a body, with noise."""
    rng = np.random.default_rng(seed)
    points, normals = spread(Mesh(*to_arrays(actual)), count, rng)
    return points + NOISE * rng.normal(size=count)[:, None] * normals


def table(width: float = 34.0, count: int = 6000) -> Floats:
    """Points on a plane under the block, all round it."""
    rng = np.random.default_rng(5)
    points = np.column_stack([rng.uniform(-width, width, (count, 2)), rng.normal(-6, NOISE, count)])
    return points[(np.abs(points[:, 0]) > 12.3) | (np.abs(points[:, 1]) > 9.3)]
