"""Shallow wear in scans whose points lie farther apart than the tolerance, with known truth."""

from __future__ import annotations

from typing import Any

import numpy as np
from manifold3d import Manifold

import damageest
from damageest.artefacts import Floats, Mesh, Part, Solid
from damageest.geometry.solids import to_arrays
from damageest.result import Result
from tests.scenes import spread

GAP = 0.65
"""Edge in mm of the square that each point stands for."""


def block() -> Any:
    return Manifold.cube((30, 24, 8), True)


def pocket(depth: float) -> Any:
    """A flat pocket in the top."""
    return Manifold.cube((12, 16, 8), True).translate((4, 1, 8 - depth))


def pad(height: float) -> Any:
    """Added metal of the same size on the top."""
    return Manifold.cube((12, 16, 2 * height), True).translate((4, 1, 4)) - block()


def scan(body: Any, noise: float = 0.0, seed: int = 1) -> Floats:
    mesh = Mesh(*to_arrays(body))
    rng = np.random.default_rng(seed)
    points, normals = spread(mesh, int(mesh.area / GAP**2), rng)
    return np.asarray(points + noise * rng.normal(size=len(points))[:, None] * normals)


def as_part(body: Any) -> Part:
    return Part(*to_arrays(body))


def as_solid(body: Any) -> Solid:
    return Solid(*to_arrays(body))


def run(points: Floats, tolerance: float, **more: Any) -> Result:
    job = {"version": 1, "units": "mm", "tolerance": tolerance, "align": "none", **more}
    return damageest.run(job, part=as_part(block()), scan=points)
