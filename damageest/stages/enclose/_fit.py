"""Local surface fits: thinning, normals and smoothing of noisy points that lie on a surface with sharp edges."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints


def thinned(points: Floats, cell: float) -> tuple[Floats, Ints]:
    """Means (M,3) of the points (N,3) in each cube of edge ``cell``, and how many each stands for."""
    keys = np.floor((points - points.min(0)) / cell).astype(np.int64)
    size = keys.max(0) + 1
    flat = (keys[:, 0] * size[1] + keys[:, 1]) * size[2] + keys[:, 2]
    _, group, counts = np.unique(flat, return_inverse=True, return_counts=True)
    sums = np.stack([np.bincount(group, points[:, axis]) for axis in range(3)], axis=1)
    return sums / counts[:, None], counts.astype(np.int64)


def subset(points: Floats, cell: float) -> Ints:
    """Index of the first of the points (N,3) in each cube of edge ``cell``."""
    keys = np.floor((points - points.min(0)) / cell).astype(np.int64)
    size = keys.max(0) + 1
    return np.sort(np.unique((keys[:, 0] * size[1] + keys[:, 1]) * size[2] + keys[:, 2], return_index=True)[1])


def neighbours(points: Floats, count: int, among: Floats | None = None, reach: float = np.inf) -> tuple[Floats, Ints]:
    """Distances and indices (N,count) of each point's nearest ``among`` others, or among all, itself first. Beyond
    ``reach`` the distance is infinite and the index no point's."""
    from scipy.spatial import cKDTree

    among = points if among is None else among
    count = min(count, len(among))
    distance, index = cKDTree(among).query(points, k=count, distance_upper_bound=reach, workers=2)
    return np.reshape(distance, (len(points), count)), np.reshape(index, (len(points), count))


def smoothed(points: Floats, noise: float, count: int = 32, rounds: int = 3) -> tuple[Floats, Floats, Floats]:
    """Points moved onto a local fit, unit normals of either sign, and the radius of each fit.

    Planes are fitted to the neighbours that agree in direction (bilateral weights, after Fleishman et al. 2003), so
    that an edge between two faces stays one; then a quadric in the plane's frame takes the curvature. A point moves
    along its normal only, by three times the noise at most.
    """
    distance, index = neighbours(points, count)
    reach = np.maximum(distance[:, -1], 1e-12)
    near = np.exp(-2.0 * (distance / reach[:, None]) ** 2)
    normals, _ = _planes(points, index, near)
    weights = near
    for _ in range(rounds):
        agree = np.einsum("ij,ikj->ik", normals, normals[index]) ** 2
        # How far a neighbour lies off this point's tangent plane tells faces apart where directions do not yet.
        off = np.einsum("ij,ikj->ik", normals, points[index] - points[:, None])
        limit = np.maximum(3 * noise, 0.25 * reach)[:, None]
        weights = near * np.exp(-(1 - agree) / 0.12) * np.exp(-((off / limit) ** 2)) + 1e-9
        normals, _ = _planes(points, index, weights)
    return _onto_quadric(points, normals, index, weights, reach, noise)


def _planes(points: Floats, index: Ints, weights: Floats) -> tuple[Floats, Floats]:
    total = weights.sum(axis=1)
    around = points[index]
    mean = np.einsum("ik,ikj->ij", weights, around) / total[:, None]
    off = around - mean[:, None]
    spread = np.einsum("ik,ikj,ikl->ijl", weights, off, off, optimize=True)
    return np.linalg.eigh(spread)[1][:, :, 0], mean


def _onto_quadric(
    points: Floats, normals: Floats, index: Ints, weights: Floats, reach: Floats, noise: float
) -> tuple[Floats, Floats, Floats]:
    helper = np.eye(3)[np.abs(normals).argmin(axis=1)]
    u = np.cross(normals, helper)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(normals, u)
    off = (points[index] - points[:, None]) / reach[:, None, None]
    a, b, h = (np.einsum("ij,ikj->ik", axis, off) for axis in (u, v, normals))
    terms = np.stack([np.ones_like(a), a, b, a * a, a * b, b * b], axis=2)
    heavy = weights[:, :, None] * terms
    left = np.einsum("iks,ikt->ist", heavy, terms, optimize=True)
    # Bending is only taken where the neighbours ask for it: a light penalty keeps thin neighbourhoods flat.
    left += np.diag([1e-9, 1e-6, 1e-6, 3e-4, 3e-4, 3e-4]) * weights.sum(axis=1)[:, None, None]
    right = np.einsum("iks,ik->is", heavy, h)
    fit = np.linalg.solve(left, right[:, :, None])[:, :, 0]
    move = np.clip(fit[:, 0] * reach, -3 * noise, 3 * noise)
    tilted = normals - fit[:, 1, None] * u - fit[:, 2, None] * v
    tilted /= np.linalg.norm(tilted, axis=1)[:, None]
    return points + move[:, None] * normals, tilted, reach
