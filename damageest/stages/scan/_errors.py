"""Errors of a real scanner: noise, smooth waviness, depth steps, second sheets, misplaced views."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.stages.scan._random_field import RandomField


def grow(sigma: float, share: Floats, power: float, facing: Floats, slant: float) -> Floats:
    """The standard deviation (N,) of the noise of points at ``share`` (N,) of the distance at which it is ``sigma``,
    under incidence angles of cosine ``facing`` (N,): it grows with these powers of the distance and of 1 / cosine."""
    return np.asarray(sigma * share**power * np.maximum(facing, 0.05) ** -slant)


def add_noise(points: Floats, sigma: Floats | float, toward: Floats | None, rng: np.random.Generator) -> Floats:
    """Points (N,3) with normal noise of standard deviation ``sigma``, one for all or (N,): along each axis, or only
    along unit vectors ``toward`` (N,3)."""
    if toward is None:
        return points + rng.normal(scale=np.reshape(sigma, (-1, 1)), size=points.shape)
    return np.asarray(points + rng.normal(scale=sigma, size=len(points))[:, None] * toward)


def add_waviness(points: Floats, toward: Floats, view: Ints, height: float, wavelength: float, seed: int) -> Floats:
    """Points (N,3) displaced along the unit vectors ``toward`` (N,3) by a smooth random field of standard deviation
    ``height``; each view, of ``view`` (N,), has a field of its own."""
    moved = points.copy()
    for number in np.unique(view):
        own = view == number
        field = RandomField.build(wavelength, 1, 1_000_003 * (int(number) + 1) + seed, waves=16)
        moved[own] += (height * field.evaluate(points[own]))[:, None] * toward[own]
    return moved


def add_sheet(points: Floats, toward: Floats, places: NDArray[np.bool_], by: float, rng: np.random.Generator) -> Floats:
    """Points (N,3) of which every second one in ``places`` (N,) is moved by ``by`` along ``toward`` (N,3)."""
    moved = places & (rng.random(len(points)) < 0.5)
    return np.asarray(points + (by * moved)[:, None] * toward)


def quantise_depth(points: Floats, origins: Floats, step: float, power: float, reach: Floats) -> Floats:
    """Points (N,3) moved along the rays from ``origins`` (N,3) to the nearest step of the distance.

    At distance z, the steps are ``step`` (z / reach)^p wide, with ``reach`` (N,) and p = ``power``: the integral of
    their number over the distance is rounded. A stereo camera, p = 2, rounds its disparity, which is proportional to
    1 / z.
    """
    way = points - origins
    depth = np.linalg.norm(way, axis=1, keepdims=True)
    if not power:
        return np.asarray(origins + way / depth * (step * np.round(depth / step)))
    share, unit = depth / reach[:, None], step / reach[:, None]
    if power == 1:
        rounded = np.exp(unit * np.round(np.log(share) / unit))
    else:
        count = np.round(share ** (1 - power) / (1 - power) / unit)
        if power > 1:
            count = np.minimum(count, -1)  # step 0 is at infinity
        rounded = ((1 - power) * unit * count) ** (1 / (1 - power))
    return np.asarray(origins + way / depth * (rounded * reach[:, None]))


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
