"""More points between those of a sparse scan, so that no gap is wider than the grid of the surface resolves."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Floats, Ints
from damageest.geometry.neighbourhoods import find_neighbours, pick_one_per_cube
from damageest.geometry.vectors import normalise
from damageest.stages.enclose._refit import fit_places

WIDE, WIDE_IF_DEEP = 2.0, 4.7
"""Gap between points, in cells, from which points are put between them. Nothing holds the solution in such a gap: it
bulges there, by up to the gap. The second for a deep loss, of which a bulge is a small share: more points gain less
there than their own errors at the rim take."""
DEEP = 4.0
"""Depth of a loss in gaps between its points from which it is deep."""
STEP = 0.8
"""Distance between the new points, in cells."""
MOST_ALONG = 8
"""Steps in a gap, at most; a wider gap gets wider steps."""
RING = 6
"""A disc about a point that holds this many neighbours has the area of one more square gaps."""
NEIGHBOURS = 12
"""Points that each new point is fitted to."""
REACH = 0.85
"""Distance from the nearest point, in gaps, up to which there are new points. What is farther is a hole in the scan."""
LOPSIDED = 0.3
"""Largest distance of the neighbours' mean beside a new point, in distances of the farthest: where it is more, the new
point would lie beyond the border of the points."""


def fill_gaps(points: Floats, normals: Floats, depth: Floats, cell: float) -> tuple[Floats, Floats]:
    """The points (N,3) and unit normals (N,3), and after them new ones in gaps that are wider than some cells.

    ``depth`` (N,): of the points below the skin. The new points lie on the surface through their neighbours. None lies
    beyond the border of the points, nor in a hole, which is wider than the usual gap there.
    """
    if len(points) <= NEIGHBOURS:
        return points, normals
    distance, _ = find_neighbours(points, RING + 1)
    gap = distance[:, -1] * np.sqrt(np.pi / (RING + 1))
    is_deep = float(np.quantile(depth, 0.95)) > DEEP * float(np.median(gap))
    wide = np.flatnonzero(gap > (WIDE_IF_DEEP if is_deep else WIDE) * cell)
    if not len(wide):
        return points, normals
    places, source = _lay_out(points, normals, gap, wide, STEP * cell)
    distance, index = find_neighbours(places, NEIGHBOURS, points)
    fit = fit_places(places, normals[source], points, normals, distance, index)
    kept = fit.is_known & (fit.lopsided < LOPSIDED) & (distance[:, 0] < REACH * gap[source])
    kept &= np.abs(fit.move) < 0.5 * gap[source]
    new = places[kept] + fit.move[kept, None] * fit.normals[kept]
    return np.concatenate([points, new]), np.concatenate([normals, fit.normals[kept]])


def _lay_out(points: Floats, normals: Floats, gap: Floats, wide: Ints, step: float) -> tuple[Floats, Ints]:
    """Places (M,3) in the tangent planes of the points ``wide`` (W,), about a ``step`` apart, and the point (M,) whose
    plane each lies in."""
    half = np.arange(-MOST_ALONG, MOST_ALONG + 1)
    grid = np.stack(np.meshgrid(half, half), axis=-1).reshape(-1, 2)
    steps = np.maximum(step, gap[wide] / MOST_ALONG)
    helper = np.eye(3)[np.abs(normals[wide]).argmin(axis=1)]
    first = normalise(np.cross(normals[wide], helper))
    second = np.cross(normals[wide], first)
    within = np.linalg.norm(grid, axis=1)[None] * steps[:, None] < gap[wide, None]
    at, of_grid = np.nonzero(within)
    off = grid[of_grid] * steps[at, None]
    places = points[wide[at]] + off[:, :1] * first[at] + off[:, 1:] * second[at]
    near = find_neighbours(places, 1, points)[0][:, 0]
    far = np.flatnonzero(near > 0.5 * step)
    kept = far[pick_one_per_cube(places[far], step)]
    return places[kept], wide[at[kept]]
