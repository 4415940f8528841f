"""Local surface fits: normals and smooth positions of noisy points on a surface with sharp edges.

Points and noise are in one unit, points in one frame.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import find_neighbours, make_tree, query_neighbours
from damageest.isolation.foresee import require_memory

ROUNDS = 3
"""How often the planes are fitted again with the weights that the last normals give."""
SCALES = (32, 80, 200)
"""Numbers of neighbours among which the width of a fit is chosen."""
KAPPA = 2.0
"""Standard deviations by which two fits of one point may differ because of noise."""
BYTES_OF_NEIGHBOUR = 140
"""Memory of a fit for each of its neighbours, measured."""
CHUNK = 500
"""Points fitted at a time, so that their neighbours fit in the processor's cache."""


def smooth_points(points: Floats, noise: float, count: int = 32) -> tuple[Floats, Floats, Floats]:
    """Points (N,3) moved onto local fits, their unit normals (N,3) of either sign, and the radius (N,) of each fit.

    A plane is fitted to the neighbours whose direction agrees (bilateral weights, after Fleishman et al. 2003), so that
    a sharp edge stays sharp. Then a quadric over that plane gives the curvature. Each point moves along its normal by
    at most three times the noise.

    Args:
        points: (N,3); at least 6, and more than ``count`` for useful fits.
        noise: standard deviation of the points from the surface.
        count: neighbours of each fit; its radius is the distance to the farthest.
    """
    _require_memory(points, count)
    distance, index = find_neighbours(points, count)
    normals, weights = _fit_planes(points, index, distance, noise)
    move, tilted, _ = _fit_quadric(points, normals, points[index], weights, distance[:, -1])
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
    _require_memory(points, SCALES[0])
    tree = make_tree(points)
    distance, index = query_neighbours(tree, points, min(SCALES[0], len(points)))
    normals, _ = _fit_planes(points, index, distance, noise)
    out, tilted = points[chosen], normals[chosen]
    for start in range(0, len(chosen), CHUNK):
        own = slice(start, start + CHUNK)
        out[own], tilted[own] = _choose_widest(tree, points, counts, noise, normals, chosen[own])
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
    around, their_normals, share = points[index], normals[index], counts[index].astype(np.float64)
    for scale in SCALES:
        near = slice(0, scale)
        far = distance[:, near]
        weights = share[:, near] * _weigh_bilateral(at, way, around[:, near], their_normals[:, near], far, noise)
        move, tilted, row = _fit_quadric(at, way, around[:, near], weights, np.maximum(far[:, -1], 1e-12))
        spread = noise**2 * (row**2 / share[:, near]).sum(axis=1)
        for other, variance in narrower_fits:
            is_explained &= (move - other) ** 2 <= KAPPA**2 * np.maximum(variance - spread, 1e-3 * variance)
        best[is_explained] = (at + np.clip(move, -3 * noise, 3 * noise)[:, None] * way)[is_explained]
        normals_of_best[is_explained] = tilted[is_explained]
        narrower_fits.append((move, spread))
    return best, normals_of_best


def _fit_planes(points: Floats, index: Ints, distance: Floats, noise: float) -> tuple[Floats, Floats]:
    """Normals (N,3) of planes through the neighbours of agreeing direction, and the neighbours' weights (N,K)."""
    around = points[index]
    weights = np.exp(-2.0 * (distance / np.maximum(distance[:, -1:], 1e-12)) ** 2)
    normals = _find_least_spread(around, weights)
    for _ in range(ROUNDS):
        weights = _weigh_bilateral(points, normals, around, normals[index], distance, noise)
        normals = _find_least_spread(around, weights)
    return normals, weights


def _weigh_bilateral(
    at: Floats, normals: Floats, around: Floats, their_normals: Floats, distance: Floats, noise: float
) -> Floats:
    """Weights (N,K) of neighbours (N,K,3): large for those that are near, of the same direction, and close to the
    point's tangent plane."""
    reach = np.maximum(distance[:, -1:], 1e-12)
    agree = np.einsum("ij,ikj->ik", normals, their_normals) ** 2
    # A neighbour far off this point's tangent plane is on another face, even while the directions still agree.
    off = np.einsum("ij,ikj->ik", normals, around - at[:, None]) / np.maximum(3 * noise, 0.25 * reach)
    return np.asarray(np.exp(-2.0 * (distance / reach) ** 2 - (1 - agree) / 0.12 - off**2) + 1e-9)


def _find_least_spread(around: Floats, weights: Floats) -> Floats:
    """The direction (N,3) in which weighted points (N,K,3) have the smallest variance."""
    mean = np.einsum("ik,ikj->ij", weights, around) / weights.sum(axis=1)[:, None]
    off = around - mean[:, None]
    return np.asarray(np.linalg.eigh(np.matmul((weights[:, :, None] * off).transpose(0, 2, 1), off))[1][:, :, 0])


def _fit_quadric(
    at: Floats, normals: Floats, around: Floats, weights: Floats, reach: Floats
) -> tuple[Floats, Floats, Floats]:
    """Height (N,) over each point of the quadric through its neighbours (N,K,3), the quadric's normal there (N,3), and
    the weight (N,K) of each neighbour's height in that height."""
    reach = np.maximum(reach, 1e-12)
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, helper)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(normals, u)
    off = (around - at[:, None]) / reach[:, None, None]
    a, b, h = (np.einsum("ij,ikj->ik", axis, off) for axis in (u, v, normals))
    terms = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=1)
    heavy = weights[:, None] * terms
    left = np.matmul(heavy, terms.transpose(0, 2, 1))
    # A small penalty on the curvature keeps the fit flat where the neighbours lie in a narrow strip.
    left += np.diag([1e-9, 1e-6, 1e-6, 3e-4, 3e-4, 3e-4]) * weights.sum(axis=1)[:, None, None]
    # (N,6,3): the weight of each moment in height and slopes; the matrix is symmetric
    of_moments = np.linalg.solve(left, np.broadcast_to(np.eye(6, 3), (len(at), 6, 3)))
    fit = np.matmul(np.matmul(heavy, h[:, :, None])[:, None, :, 0], of_moments)[:, 0]
    tilted = normals - fit[:, 1, None] * u - fit[:, 2, None] * v
    tilted /= np.linalg.norm(tilted, axis=1)[:, None]
    return fit[:, 0] * reach, tilted, np.matmul(of_moments[:, None, :, 0], heavy)[:, 0]
