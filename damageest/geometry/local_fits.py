"""Local surface fits: normals and smooth positions of noisy points on a surface with sharp edges.

Points and noise are in one unit, points in one frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import find_neighbours, make_tree, query_neighbours
from damageest.geometry.threads import cut_evenly, map_in_threads
from damageest.geometry.vectors import normalise
from damageest.isolation.memory import require_memory

Floats32 = NDArray[np.float32]

ROUNDS = 3
"""How often the planes are fitted again with the weights that the last normals give."""
SCALES = (32, 80, 200)
"""Numbers of neighbours among which the width of a fit is chosen."""
FEW, OF_ALL = 8, 5
"""Neighbours of the planes that the fits start from, at least, and one in so many of all points: of few points, 32 lie
on several faces."""
KAPPA = 2.0
"""Standard deviations by which two fits of one point may differ because of noise."""
BYTES_OF_NEIGHBOUR = 35
"""Memory of a fit for each of its neighbours, measured."""
CHUNK = 500
"""Points fitted at a time, so that their neighbours fit in the processor's cache."""


def smooth_points(points: Floats, noise: float, count: int = 32) -> tuple[Floats, Floats, Floats]:
    """Points (N,3) moved onto local fits, their unit normals (N,3) of either sign, and the radius (N,) of each fit.

    A plane is fitted to the neighbours whose direction agrees (bilateral weights, after Fleishman et al. 2003), so that
    a sharp edge stays sharp. Then a quadric over that plane gives the curvature. Each point moves along its normal by
    at most three times the noise.

    Args:
        points: (N,3); at least 6, and more than ``count``, for useful fits; fewer stay about where they are.
        noise: standard deviation of the points from the surface.
        count: neighbours of each fit; its radius is the distance to the farthest.
    """
    if not len(points):
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    _require_memory(points, count)
    distance, index = find_neighbours(points, count)
    normals, before = _fit_planes(points, index, distance, noise)
    weigh = _weigh_by(before, points, index, distance, noise)
    found = map_in_threads(
        lambda own: _fit_quadric(normals[own], *weigh(own), distance[own, -1])[:2], cut_evenly(len(points), CHUNK)
    )
    move, tilted = (np.concatenate(column) for column in zip(*found, strict=True))
    return points + np.clip(move, -3 * noise, 3 * noise)[:, None] * normals, tilted, distance[:, -1]


def average_points(points: Floats, counts: Ints, noise: float, chosen: Ints) -> tuple[Floats, Floats]:
    """Some of the points moved onto the widest local fits that agree with the data: points (M,3) and unit normals (M,3)
    of either sign.

    As `smooth_points`, but the number of neighbours is chosen for each point. A wider fit averages out more noise, but
    has an error where the surface is more curved than a quadric can follow. So the widest fit is taken that differs
    from every narrower one by no more than noise explains (Lepski 1991).

    Args:
        points: (N,3).
        counts: (N,) how many scan points each point is the mean of; the variance of the noise is divided by it.
        noise: standard deviation of one scan point from the surface.
        chosen: (M,) indices of the points to move.
    """
    if not len(chosen):
        return np.empty((0, 3)), np.empty((0, 3))
    _require_memory(points, SCALES[0])
    tree = make_tree(points)
    distance, index = query_neighbours(tree, points, min(SCALES[0], max(FEW, len(points) // OF_ALL), len(points)))
    normals, _ = _fit_planes(points, index, distance, noise)
    found = map_in_threads(
        lambda own: _choose_widest(tree, points, counts, noise, normals, chosen[own]), cut_evenly(len(chosen), CHUNK)
    )
    out, tilted = (np.concatenate(column) for column in zip(*found, strict=True))
    return out, tilted


def _require_memory(points: Floats, count: int) -> None:
    needed = BYTES_OF_NEIGHBOUR * count * len(points)
    require_memory(needed, f"local fits at {len(points):,} points", "a larger tolerance, or more memory (--memory)")


def _choose_widest(
    tree: Any, points: Floats, counts: Ints, noise: float, normals: Floats, own: Ints
) -> tuple[Floats, Floats]:
    """Position (M,3) and normal (M,3) of the points ``own`` (M,), each by the widest fit that noise explains."""
    at, way = points[own], normals[own]
    distance, index = query_neighbours(tree, at, min(SCALES[-1], len(points)))
    best, normals_of_best = at.copy(), way.copy()
    is_explained = np.ones(len(at), bool)
    narrower_fits: list[tuple[Floats, Floats]] = []
    off, their_normals, share = _look_around(points, index, at), normals.astype(np.float32)[index], counts[index]
    share = share.astype(np.float32)
    for scale in SCALES:
        near = slice(0, scale)
        far = distance[:, near]
        weights = share[:, near] * _weigh_bilateral(way, off[:, near], their_normals[:, near], far, noise)
        move, tilted, row = _fit_quadric(way, off[:, near], weights, np.maximum(far[:, -1], 1e-12))
        spread = noise**2 * (row**2 / share[:, near]).sum(axis=1)
        for other, variance in narrower_fits:
            is_explained &= (move - other) ** 2 <= KAPPA**2 * np.maximum(variance - spread, 1e-3 * variance)
        best[is_explained] = (at + np.clip(move, -3 * noise, 3 * noise)[:, None] * way)[is_explained]
        normals_of_best[is_explained] = tilted[is_explained]
        narrower_fits.append((move, spread))
    return best, normals_of_best


def _look_around(points: Floats, index: Ints, at: Floats) -> Floats32:
    """The neighbours (N,K,3) relative to their places (N,3). Differences fit in single precision, which takes half the
    time; coordinates would not."""
    return np.asarray(points[index] - at[:, None], np.float32)


def _fit_planes(points: Floats, index: Ints, distance: Floats, noise: float) -> tuple[Floats, Floats]:
    """Normals (N,3) of planes through the neighbours of agreeing direction, and those of the round before, by which
    directions agree."""

    def start(own: slice) -> Floats:
        weights = np.exp(-2.0 * (distance[own] / np.maximum(distance[own, -1:], 1e-12)) ** 2).astype(np.float32)
        return _find_least_spread(_look_around(points, index[own], points[own]), weights)

    def fit_again(normals: Floats) -> Floats:
        weigh = _weigh_by(normals, points, index, distance, noise)
        return np.concatenate(map_in_threads(lambda own: _find_least_spread(*weigh(own)), pieces))

    pieces = cut_evenly(len(points), CHUNK)
    normals = before = np.concatenate(map_in_threads(start, pieces))
    for _ in range(ROUNDS):
        before, normals = normals, fit_again(normals)
    return normals, before


def _weigh_by(
    normals: Floats, points: Floats, index: Ints, distance: Floats, noise: float
) -> Callable[[slice], tuple[Floats32, Floats32]]:
    """What gives, for some of the points, their neighbours as `_look_around` does, and the weights of these by all
    points' ``normals`` (N,3)."""
    theirs = normals.astype(np.float32)

    def weigh(own: slice) -> tuple[Floats32, Floats32]:
        off = _look_around(points, index[own], points[own])
        return off, _weigh_bilateral(normals[own], off, theirs[index[own]], distance[own], noise)

    return weigh


def _weigh_bilateral(
    normals: Floats, off: Floats32, their_normals: Floats32, distance: Floats, noise: float
) -> Floats32:
    """Weights (N,K) of neighbours (N,K,3): large for those that are near, of the same direction, and close to the
    point's tangent plane."""
    reach = np.maximum(distance[:, -1:], 1e-12)
    own = normals.astype(np.float32)[:, :, None]
    agree = np.matmul(their_normals, own)[:, :, 0] ** 2
    # A neighbour far off this point's tangent plane is on another face, even while the directions still agree.
    height = np.matmul(off, own)[:, :, 0] / np.maximum(3 * noise, 0.25 * reach).astype(np.float32)
    near = (distance / reach).astype(np.float32)
    return np.asarray(np.exp(-2 * near**2 - (1 - agree) / np.float32(0.12) - height**2) + np.float32(1e-9))


def _find_least_spread(off: Floats32, weights: Floats32) -> Floats:
    """The direction (N,3) in which weighted points (N,K,3) have the smallest variance."""
    mean = np.matmul(weights[:, None], off) / weights.sum(axis=1)[:, None, None]
    off = off - mean
    spread = np.matmul((weights[:, :, None] * off).transpose(0, 2, 1), off)
    return np.asarray(np.linalg.eigh(spread.astype(np.float64))[1][:, :, 0])


def _fit_quadric(normals: Floats, off: Floats32, weights: Floats32, reach: Floats) -> tuple[Floats, Floats, Floats]:
    """Height (N,) over each point of the quadric through its neighbours (N,K,3), the quadric's normal there (N,3), and
    the weight (N,K) of each neighbour's height in that height."""
    reach = np.maximum(reach, 1e-12)
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, helper)
    u = normalise(u)
    v = np.cross(normals, u)
    axes = np.stack([u, v, normals], axis=2) / reach[:, None, None]
    a, b, h = np.moveaxis(np.matmul(off, axes.astype(np.float32)), 2, 0)
    terms = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=1)
    heavy = weights[:, None] * terms
    left = np.matmul(heavy, terms.transpose(0, 2, 1)).astype(np.float64)
    # A small penalty on the curvature keeps the fit flat where the neighbours lie in a narrow strip.
    left += np.diag([1e-9, 1e-6, 1e-6, 3e-4, 3e-4, 3e-4]) * weights.sum(axis=1)[:, None, None]
    # (N,6,3): the weight of each moment in height and slopes; the matrix is symmetric
    of_moments = np.linalg.solve(left, np.broadcast_to(np.eye(6, 3), (len(off), 6, 3)))
    fit = np.matmul(np.matmul(heavy, h[:, :, None])[:, None, :, 0], of_moments)[:, 0]
    tilted = normals - fit[:, 1, None] * u - fit[:, 2, None] * v
    tilted = normalise(tilted)
    return fit[:, 0] * reach, tilted, np.matmul(of_moments[:, None, :, 0].astype(np.float32), heavy)[:, 0]
