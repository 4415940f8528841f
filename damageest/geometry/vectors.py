"""Vectors in rows."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Vector


def cross_corners(corners: Floats) -> Floats:
    """(F,3) normals of triangles with ``corners`` (F,3,3), scaled by twice the area."""
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def to_vector(values: Floats) -> Vector:
    """Three numbers (3,) as a tuple."""
    x, y, z = values.tolist()
    return x, y, z


def normalise(vectors: Floats, least: float = 1e-300) -> Floats:
    """(...,3) the vectors scaled to length 1; 0 stays 0, and one shorter than ``least``, which is rounding, short."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), least))


def measure_to_sphere(points: Floats, directions: Floats, centre: Floats, radius: float) -> Floats:
    """How far (N,) the sphere is from points (N,3) along unit ``directions`` (N,3), where it is left; negative where it
    lies behind, and the place nearest to ``centre`` (3,) where it is missed."""
    away = points - centre
    along = np.einsum("ni,ni->n", away, directions)
    root = np.sqrt(np.maximum(along**2 - np.einsum("ni,ni->n", away, away) + radius**2, 0.0))
    return np.asarray(root - along)


def measure_longest_edges(triangles: Floats) -> Floats:
    """(F,) the length of the longest edge of each of the triangles (F,3,3), in their unit."""
    squares = []
    for k in range(3):  # edge by edge: numpy's norm of all at once takes several times as long
        x, y, z = (triangles[:, k] - triangles[:, k - 1]).T
        squares.append(x * x + y * y + z * z)
    return np.asarray(np.sqrt(np.maximum(np.maximum(squares[0], squares[1]), squares[2])))


def spread_directions(count: int) -> Floats:
    """Unit vectors (count,3), evenly over the sphere: a Fibonacci lattice."""
    step = np.arange(count) + 0.5
    polar, azimuth = np.arccos(1 - 2 * step / count), np.pi * (1 + 5**0.5) * step
    return np.stack([np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1)
