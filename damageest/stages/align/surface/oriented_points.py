"""Draws few, evenly spread, oriented points from a scan of any size and density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.geometry.duplicates import order_integers
from damageest.geometry.morton import encode_cells
from damageest.geometry.sampling import sample_by_area
from damageest.geometry.sheets import find_own_sheet, measure_spread
from damageest.geometry.threads import count_threads
from damageest.geometry.vectors import spread_directions
from damageest.geometry.voxels import measure_bounds

MAX_DENSE = 120_000
"""Number of scan points that density and normals are measured on; more only cost time."""

NEIGHBOURS = 64
"""Number of points that a normal is fitted to, at most, where the noise does not ask for more."""

MAX_NEIGHBOURS = 512
"""The same where it does: fewer, in a dense scan, would all lie within the noise and show no plane."""

FLAT = 0.15
"""Least of the squared widths of a neighbourhood over the second, below which it is flat."""

MOSTLY = 0.5
"""Share of flat neighbourhoods below which those of one skin are looked for."""

MAX_RADIUS = 0.05
"""Largest distance in diagonals of the part of the points that a normal is fitted to."""


@dataclass(frozen=True)
class OrientedPoints:
    """``points`` (N,3) and unit ``normals`` (N,3). ``signed``: whether all normals point outward; if not, their sign is
    arbitrary."""

    points: Floats
    normals: Floats
    signed: bool

    def take(self, index: Ints) -> OrientedPoints:
        """The points at the indices ``index``."""
        return OrientedPoints(self.points[index], self.normals[index], self.signed)


def draw_stratified(count: int, wanted: int, rng: np.random.Generator) -> Ints:
    """About ``wanted`` of ``count`` indices, by stratified sampling: one from each of ``wanted`` equal intervals."""
    if wanted >= count:
        return np.arange(count)
    edges = np.linspace(0, count, wanted + 1)
    return np.minimum((edges[:-1] + rng.random(wanted) * np.diff(edges)).astype(np.int64), count - 1)


def draw_evenly(points: Floats, weights: Floats, wanted: int, rng: np.random.Generator) -> Ints:
    """Draws about ``wanted`` different indices with probability proportional to ``weights`` (N,), evenly in space.

    Systematic sampling along a Morton curve: neighbours on the curve are neighbours in space, so equal steps of the
    summed weight leave neither clusters nor gaps.
    """
    if wanted >= len(points):
        return np.arange(len(points))
    low, high = measure_bounds(points)
    cells = ((points - low) / max(float((high - low).max()), 1e-300) * 1023).astype(np.int64)
    order = order_integers(encode_cells(cells))
    total = np.cumsum(weights[order])
    at = (np.arange(wanted) + rng.random(wanted)) / wanted * total[-1]
    return np.unique(order[np.minimum(np.searchsorted(total, at), len(order) - 1)])


def orient_scan(
    points: Floats, normals: Floats | None, noise: float, wanted: int, rng: np.random.Generator
) -> tuple[Floats, Floats, OrientedPoints]:
    """The dense subset (D,3), the weight of each of its points (D,), and about ``wanted`` oriented points.

    ``points`` (N,3) and ``noise`` in diagonals of the part. The weight of a point is the area that it represents, so
    that the density of the scan does not matter; a point far from its neighbours is an outlier and has weight 0.
    Normals are principal axes of neighbourhoods that are wide enough for the noise. Their sign is known only where the
    scan has ``normals`` (N,3).
    """
    from scipy.spatial import cKDTree

    index = draw_stratified(len(points), MAX_DENSE, rng)
    every = points[index]
    tree = cKDTree(every)
    # neighbours are searched among all points, but only for every second point where there are many
    index = index[:: 1 + (len(index) > MAX_DENSE // 2)]
    dense = points[index]
    reach = np.asarray(tree.query(dense, k=min(9, len(every)), workers=count_threads())[0])[:, -1]
    typical = float(np.median(reach))
    weights = np.where(reach < 5 * typical, np.minimum(reach, 2.5 * typical) ** 2, 0.0)

    chosen = draw_evenly(dense, weights, wanted, rng)
    radius = float(np.clip(2.5 * typical, 0.006, 0.03))
    count_near = NEIGHBOURS
    if 8 * noise > radius:
        radius = float(min(8 * noise, MAX_RADIUS))
        # so many points lie within the radius, as far as the noise leaves them near the surface
        count_near = int(np.clip(9 * (radius / max(typical, 1e-300)) ** 2, NEIGHBOURS, MAX_NEIGHBOURS))
    near = np.asarray(
        tree.query(dense[chosen], k=min(count_near, len(every)), distance_upper_bound=radius, workers=count_threads())[
            1
        ]
    )
    there = near < len(every)
    off = every[np.minimum(near, len(every) - 1)] - dense[chosen][:, None]
    direction, flat = _fit_normals(off, there)
    if flat.mean() < MOSTLY:  # the part is of thin walls, and neighbours lie on both of their skins
        direction, flat = _fit_normals(off, find_own_sheet(off, there))
    if normals is not None:
        given = normals[index][chosen]
        direction = np.where(np.einsum("ij,ij->i", direction, given)[:, None] < 0, -direction, direction)
        flat &= np.linalg.norm(given, axis=1) > 0.5
    keep = np.flatnonzero(flat)
    return dense, weights, OrientedPoints(dense[chosen][keep], direction[keep], normals is not None)


def _fit_normals(off: Floats, chosen: Flags) -> tuple[Floats, Flags]:
    """Normals (N,3) of planes through the ``chosen`` (N,K) neighbours (N,K,3), and whether these are flat (N,)."""
    value, axes = np.linalg.eigh(measure_spread(off, chosen))
    return axes[:, :, 0], (chosen.sum(axis=1) >= 6) & (value[:, 0] < FLAT * value[:, 1])


def orient_surface(part: Mesh, wanted: int, rng: np.random.Generator) -> OrientedPoints:
    """``wanted`` points spread over a mesh by area, with the normals of their faces."""
    points, face = sample_by_area(part, wanted, rng)
    return OrientedPoints(points, part.face_normals[face], True)


def draw_by_direction(cloud: OrientedPoints, wanted: int, rng: np.random.Generator) -> OrientedPoints:
    """``wanted`` points of a cloud, with rare directions of the normal drawn more often: the edge faces of a plate fix
    its pose better than more points on its large faces."""
    count = 128
    match = cloud.normals @ spread_directions(count).T
    nearest = np.argmax(match if cloud.signed else np.abs(match), axis=1)
    weights = 1 / np.sqrt(np.bincount(nearest, minlength=count)[nearest])
    return cloud.take(draw_evenly(cloud.points, weights, wanted, rng))
