"""Local surface fits: thinning, normals and smoothing of noisy points that lie on a surface with sharp edges."""

from __future__ import annotations

from typing import Any

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import find_neighbours

ROUNDS = 3
SCALES = (32, 80, 200)
"""Neighbours of the fits to choose from."""
KAPPA = 2.0
"""Standard deviations that two fits of one point may lie apart by noise."""
CHUNK = 500


def smooth_points(points: Floats, noise: float, count: int = 32) -> tuple[Floats, Floats, Floats]:
    """Points moved onto a local fit, unit normals of either sign, and the radius of each fit.

    Planes are fitted to the neighbours that agree in direction (bilateral weights, after Fleishman et al. 2003), so
    that an edge between two faces stays one; then a quadric in the plane's frame takes the curvature. A point moves
    along its normal only, by three times the noise at most.
    """
    distance, index = find_neighbours(points, count)
    normals, weights = _fit_planes(points, index, distance, noise)
    move, tilted, _ = _fit_quadric(points, normals, points[index], weights, distance[:, -1])
    return points + np.clip(move, -3 * noise, 3 * noise)[:, None] * normals, tilted, distance[:, -1]


def average_points(points: Floats, counts: Ints, noise: float, chosen: Ints) -> tuple[Floats, Floats]:
    """As `smoothed`, but each of the ``chosen`` (M,) points is fitted to as many neighbours as agree: points (M,3) and
    normals (M,3).

    A wider fit averages more noise, and bends what is more curved than it can follow. So it is taken where it lies as
    close to every narrower one as noise explains (Lepski's choice of scale). ``counts`` (N,): how many scan points each
    point is the mean of, which divides the variance of the ``noise``.
    """
    from scipy.spatial import cKDTree

    distance, index = find_neighbours(points, SCALES[0])
    normals, _ = _fit_planes(points, index, distance, noise)
    out, tilted = points[chosen], normals[chosen]
    tree = cKDTree(points)
    for start in range(0, len(chosen), CHUNK):
        own = slice(start, start + CHUNK)
        out[own], tilted[own] = _choose_widest(tree, points, counts, noise, normals, chosen[own])
    return out, tilted


def _choose_widest(
    tree: Any, points: Floats, counts: Ints, noise: float, normals: Floats, own: Ints
) -> tuple[Floats, Floats]:
    """The fits of the points ``own``, of each the widest that noise explains."""
    at, way = points[own], normals[own]
    distance, index = tree.query(at, k=min(SCALES[-1], len(points)), workers=2)
    distance, index = distance.reshape(len(at), -1), index.reshape(len(at), -1)
    best, turned = at.copy(), way.copy()
    explained = np.ones(len(at), bool)
    narrower: list[tuple[Floats, Floats]] = []
    around, their_normals, share = points[index], normals[index], counts[index].astype(np.float64)
    for scale in SCALES:
        near = slice(0, scale)
        far = distance[:, near]
        weights = share[:, near] * _weigh_bilateral(at, way, around[:, near], their_normals[:, near], far, noise)
        move, tilted, row = _fit_quadric(at, way, around[:, near], weights, np.maximum(far[:, -1], 1e-12))
        spread = noise**2 * (row**2 / share[:, near]).sum(axis=1)
        for other, wide in narrower:
            explained &= (move - other) ** 2 <= KAPPA**2 * np.maximum(wide - spread, 1e-3 * wide)
        best[explained] = (at + np.clip(move, -3 * noise, 3 * noise)[:, None] * way)[explained]
        turned[explained] = tilted[explained]
        narrower.append((move, spread))
    return best, turned


def _fit_planes(points: Floats, index: Ints, distance: Floats, noise: float) -> tuple[Floats, Floats]:
    """Normals (N,3) of planes through the neighbours that agree, and the neighbours' weights (N,K)."""
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
    """Weights (N,K) of neighbours (N,K,3): near, of the same direction, in the point's own tangent plane."""
    reach = np.maximum(distance[:, -1:], 1e-12)
    agree = np.einsum("ij,ikj->ik", normals, their_normals) ** 2
    # How far a neighbour lies off this point's tangent plane tells faces apart where directions do not yet.
    off = np.einsum("ij,ikj->ik", normals, around - at[:, None]) / np.maximum(3 * noise, 0.25 * reach)
    return np.asarray(np.exp(-2.0 * (distance / reach) ** 2 - (1 - agree) / 0.12 - off**2) + 1e-9)


def _find_least_spread(around: Floats, weights: Floats) -> Floats:
    """The direction (N,3) in which weighted points (N,K,3) spread least."""
    mean = np.einsum("ik,ikj->ij", weights, around) / weights.sum(axis=1)[:, None]
    off = around - mean[:, None]
    return np.asarray(np.linalg.eigh(np.matmul((weights[:, :, None] * off).transpose(0, 2, 1), off))[1][:, :, 0])


def _fit_quadric(
    at: Floats, normals: Floats, around: Floats, weights: Floats, reach: Floats
) -> tuple[Floats, Floats, Floats]:
    """Height (N,) over each point of the quadric through its neighbours (N,K,3), the quadric's normal there (N,3), and
    what each neighbour's height adds to it (N,K)."""
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
    # Bending is only taken where the neighbours ask for it: a light penalty keeps thin neighbourhoods flat.
    left += np.diag([1e-9, 1e-6, 1e-6, 3e-4, 3e-4, 3e-4]) * weights.sum(axis=1)[:, None, None]
    # (N,6,3): of height and slopes, what the moments add to each; the matrix is symmetric
    of_moments = np.linalg.solve(left, np.broadcast_to(np.eye(6, 3), (len(at), 6, 3)))
    fit = np.matmul(np.matmul(heavy, h[:, :, None])[:, None, :, 0], of_moments)[:, 0]
    tilted = normals - fit[:, 1, None] * u - fit[:, 2, None] * v
    tilted /= np.linalg.norm(tilted, axis=1)[:, None]
    return fit[:, 0] * reach, tilted, np.matmul(of_moments[:, None, :, 0], heavy)[:, 0]
