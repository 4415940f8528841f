"""Errors of a real scanner: smooth waviness, depth steps, misplaced views."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.stages.scan._random_field import RandomField


def add_waviness(points: Floats, toward: Floats, view: Ints, height: float, wavelength: float, seed: int) -> Floats:
    """Points (N,3) displaced along the unit vectors ``toward`` (N,3) by a smooth random field of standard deviation
    ``height``; each view, of ``view`` (N,), has a field of its own."""
    moved = points.copy()
    for number in np.unique(view):
        own = view == number
        field = RandomField.build(wavelength, 1, 1_000_003 * (int(number) + 1) + seed, waves=16)
        moved[own] += (height * field.evaluate(points[own]))[:, None] * toward[own]
    return moved


def quantise_depth(points: Floats, origins: Floats, step: float) -> Floats:
    """Points (N,3) moved along the rays from ``origins`` (N,3) to the nearest multiple of ``step`` of the distance."""
    way = points - origins
    depth = np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(origins + way / depth * (step * np.round(depth / step)))


def misplace_views(
    points: Floats, view: Ints, scanners: Floats, centre: Floats, reach: float, by: float, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Points (N,3) and scanners (V,3) with each view after the first moved rigidly: by a translation of length ``by``
    in a random direction, and about ``centre`` (3,) by a rotation that moves points at distance ``reach`` by ``by``."""
    from scipy.spatial.transform import Rotation

    points, scanners = points.copy(), scanners.copy()
    for number in range(1, len(scanners)):
        shift, axis = rng.normal(size=(2, 3))
        shift *= by / np.linalg.norm(shift)
        turn = Rotation.from_rotvec(axis / np.linalg.norm(axis) * by / reach).as_matrix()
        own = view == number
        points[own] = (points[own] - centre) @ turn.T + centre + shift
        scanners[number] = turn @ (scanners[number] - centre) + centre + shift
    return points, scanners
