"""The scan points on one loss, as a surface: smoothed, thinned, and oriented toward the lost side."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.local_fits import average_points
from damageest.geometry.neighbourhoods import measure_local_areas, pick_at_most, pick_one_per_cube, thin_points
from damageest.geometry.orientation import HINT, turn_toward_void
from damageest.geometry.patches import Patches
from damageest.stages.enclose._fill_gaps import fill_gaps

OrientedPoints = tuple[Floats, Floats, Floats]
"""Points (M,3), unit normals (M,3) toward the lost side, and the area (M,) that each point stands for."""
APART = 0.75
"""Edge of the cubes with one averaged point each, in cells of the surface."""

APART_FLAT, FLAT_CUBE, RIM = 2.5, 6.0, 4.0
"""The same where the surface is flat; edge of the cubes in which it has to be flat; depth up to which points count as
near the rim. All in cells of the surface."""

FEWEST_IN_CUBE = 16
"""Points of such a cube from which its flatness is known; in a sparse scan nothing is left out."""
SURE, BENT = 2.0, 0.1
"""Such a cube is flat where the variance of its points from a plane exceeds that of their noise by no more than
``SURE`` times the error of that variance, and by the square of ``BENT`` cells."""
MOST_LOST = 5000
"""Samples of the lost skin that tell on which side of the points the lost metal is."""


def build_surface(
    points: Floats, above: Floats, depth: Floats, lost: Floats, lost_normals: Floats, noise: float, cell: float
) -> OrientedPoints:
    """The points (M,3) of one group, smoothed, thinned and oriented toward the lost side.

    ``above`` (M,3): the normal of the part's skin nearest to each point, and ``depth`` (M,) below it; ``lost`` (L,3):
    samples of the skin that is lost with them.
    """
    points, counts, first = thin_points(points, 0.5 * cell)
    # The local fits overlap much farther than this, so that more of them would add nothing.
    chosen = pick_one_per_cube(points, APART * cell)
    chosen = _thin_flat(points, chosen, counts, depth[first], noise, cell)
    above, depth = above[first][chosen], depth[first][chosen]
    points, normals = average_points(points, counts, noise, chosen)
    chosen = np.arange(len(lost)) if len(lost) <= MOST_LOST else pick_at_most(lost, 1.3 * cell, MOST_LOST, 1.3)
    places = lost[chosen]
    # A shallow point has lost the skin above it, though the gaps of the scan are too wide to show it bare: else the
    # skin lost on the other side of a bore would decide.
    hint = np.maximum(HINT, 1 / (1 + (depth / cell) ** 2))[:, None] * above
    normals = turn_toward_void(points, normals, hint, places, lost_normals[chosen], measure_local_areas(places), cell)
    points, normals = fill_gaps(points, normals, depth, cell)
    return points, normals, measure_local_areas(points)


def _thin_flat(points: Floats, chosen: Ints, counts: Ints, depth: Floats, noise: float, cell: float) -> Ints:
    """Of the points ``chosen`` (M,), one in each larger cube where the surface is flat and not near the rim.

    Flat are cubes of `FLAT_CUBE` cells in which the points (N,3) lie on a plane within their noise. Each is the mean
    of ``counts`` (N,) scan points.
    """
    cubes = Patches.in_cubes(points, FLAT_CUBE * cell)
    cube, size = cubes.group, cubes.count
    off = points - cubes.mean(points)[cube]
    moments = np.stack([np.bincount(cube, off[:, i] * off[:, j]) for i in range(3) for j in range(3)], axis=1)
    variance = np.linalg.eigvalsh(moments.reshape(-1, 3, 3) / size[:, None, None])[:, 0]
    expected = noise**2 * np.bincount(cube, 1 / counts) / size
    most = expected * (1 + SURE * np.sqrt(2 / size)) + (BENT * cell) ** 2
    plane = (size >= FEWEST_IN_CUBE) & (variance < most)
    flat = plane[cube[chosen]] & (depth[chosen] > RIM * cell)
    interior = chosen[flat]
    if not len(interior):
        return chosen
    kept = interior[pick_one_per_cube(points[interior], APART_FLAT * cell)]
    return np.sort(np.concatenate([chosen[~flat], kept]))
