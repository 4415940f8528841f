"""The part's skin near some places of it: which cubes of space it lies in, and points on it, without the rest.

Part and points are in one unit and one frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh, Part, Samples
from damageest.geometry.refinement import bisect_faces
from damageest.geometry.spreading import spread_on_faces, spread_points
from damageest.geometry.vectors import measure_longest_edges
from damageest.geometry.voxels import VoxelGrid, measure_bounds

MOST_ALONG = 100
"""Largest number of cubes along an axis: on a larger part they are larger."""
POOR = 0.15
"""Share of the usual number of intact points for its skin below which a cube has few of them."""
PLACES = 8
"""Places along a cube's edge at which the area of the skin in it is measured."""
SMALL = 0.5
"""Largest edge of a triangle that is sampled as a whole, in cubes: a larger one is halved, and only its halves near the
places are."""
COARSER = 2.0
"""Spacing of the points away from the damage, in spacings of those near it."""
MOST_POINTS = 400_000
"""Points from which on the spacing grows."""


@dataclass(frozen=True, eq=False)
class NearCubes:
    """The ``cubes`` of a ``grid`` that are near (one flag each, in the grid's order)."""

    grid: VoxelGrid
    cubes: Flags

    @classmethod
    def around(cls, points: Floats, size: float) -> NearCubes:
        """The cubes of edge ``size``, or more where there were too many, with one of the points (N,3), and those that
        touch them."""
        low, high = measure_bounds(points) if len(points) else np.zeros((2, 3))
        size = max(size, float((high - low).max()) / MOST_ALONG)
        low, high = low - 2 * size, high + 2 * size
        grid = VoxelGrid(low, size, np.ceil((high - low) / size).astype(np.int64) + 1)
        return cls(grid, grid.mark_around(points, 1))

    def holds(self, points: Floats) -> Flags:
        """Which of the points (N,3) lie in these cubes; the outermost cubes of the grid are none of them."""
        return np.asarray(self.cubes[self.grid.number_cells(points)])

    def touches(self, triangles: Floats) -> Flags:
        """Which of the triangles (F,3,3) have bounds that reach into these cubes."""
        shape = self.grid.shape
        sums = np.zeros(shape + 1, np.int64)
        sums[1:, 1:, 1:] = self.cubes.reshape(shape).cumsum(0).cumsum(1).cumsum(2)
        at = [(end(triangles, axis=1) - self.grid.low) / self.grid.size for end in (np.min, np.max)]
        low, high = (np.clip(np.floor(one).astype(np.int64), 0, shape - 1) for one in at)
        count = np.zeros(len(triangles), np.int64)
        for corner in range(8):
            is_high = np.array([corner >> axis & 1 for axis in range(3)], bool)
            x, y, z = np.where(is_high, high + 1, low).T
            count += sums[x, y, z] * (1 if is_high.sum() % 2 else -1)
        return count > 0


def find_cubes_near(part: Mesh, places: Floats, feet: Floats, intact: Floats, edge: float) -> tuple[NearCubes, Floats]:
    """The cubes of the part's skin near damage, and places (K,3) on the skin in them that the scan does not show.

    These are the cubes of ``edge``, or more where there were too many, with one of the damaged ``places`` (N,3), cubes
    connected to them whose skin has few of the ``intact`` points (M,3), and the cubes round both. Skin with few points
    is lost where ``feet`` (N,3) lie on it, the places' nearest points of the skin; else it is not shown.
    """
    from scipy.ndimage import binary_dilation, label

    every = [measure_bounds(points) for points in (part.vertices, places, intact) if len(points)]
    low, high = measure_bounds(np.concatenate(every))
    size = max(edge, float((high - low).max()) / MOST_ALONG)
    low = low - 2 * size
    grid = VoxelGrid(low, size, np.ceil((high - low) / size).astype(np.int64) + 3)
    total = int(np.prod(grid.shape))
    on_skin, area = _spread_area(part, size / PLACES)
    cell = grid.number_cells(on_skin)
    expected = np.bincount(cell, weights=area, minlength=total)
    seen = np.bincount(grid.number_cells(intact), minlength=total)
    has_skin = expected > 0
    usual = np.median(seen[has_skin] / expected[has_skin])
    has_damage = np.bincount(grid.number_cells(places), minlength=total) > 0
    poor = has_skin & (seen < POOR * usual * expected)
    around = np.ones((3, 3, 3), bool)
    joined, _ = label((has_damage | poor).reshape(grid.shape), around)
    core = np.isin(joined, np.unique(joined.ravel()[has_damage]))
    has_foot = np.bincount(grid.number_cells(feet), minlength=total) > 0
    unseen = on_skin[(core.ravel() & poor & ~has_foot)[cell]]
    return NearCubes(grid, binary_dilation(core, around).ravel()), unseen


def _spread_area(part: Mesh, step: float) -> tuple[Floats, Floats]:
    """Points (N,3) on the part, with gaps up to ``step`` on large triangles, and the area (N,) each stands for."""
    triangles = part.triangles
    area = part.face_areas
    longest = measure_longest_edges(triangles)
    is_large = (longest > step) & (area > 0)
    points, face = spread_points(triangles, np.flatnonzero(is_large), step)
    share = area / np.maximum(np.bincount(face, minlength=len(area)), 1)
    return np.concatenate([points, triangles[~is_large].mean(axis=1)]), np.concatenate([share[face], area[~is_large]])


def sample_near(part: Part, near: NearCubes, fine: NearCubes, spacing: float) -> Samples:
    """Points on the faces of the part's skin in the cubes ``near``, none on edges.

    In the cubes ``fine``, too, every place of this skin is within ``spacing`` of a point, elsewhere within `COARSER`
    times that, the spacing of the samples; both are more where that would need more than `MOST_POINTS`. The same part
    and cubes give the same points.
    """
    vertices, faces, origin = _cut_near(part, near)
    of_fine = np.flatnonzero(fine.touches(vertices[faces]))
    every, inmost = Mesh(vertices, faces), Mesh(vertices, faces[of_fine])
    needed = 1.25 * (inmost.area + (every.area - inmost.area) / COARSER**2)
    spacing = max(spacing, float(np.sqrt(needed / MOST_POINTS)))
    wide, face = spread_on_faces(every, COARSER * spacing)
    close, face_of_close = spread_on_faces(inmost, spacing)
    outer = ~fine.holds(wide) & near.holds(wide)
    inner = fine.holds(close) & near.holds(close)
    points = np.concatenate([wide[outer], close[inner]])
    face = origin[np.concatenate([face[outer], of_fine[face_of_close[inner]]])]
    return Samples(points, part.face_normals[face], face, np.zeros(len(face), np.uint8), COARSER * spacing)


def _cut_near(part: Part, near: NearCubes) -> tuple[Floats, Ints, Ints]:
    """Vertices, the faces (F,3) of the part that reach into the cubes, with large ones cut, and the face (F,) of the
    part that each of them is a piece of."""
    vertices, origin = part.vertices, np.flatnonzero(near.touches(part.triangles))
    faces, edge = part.faces[origin], SMALL * near.grid.size
    while True:
        long = np.flatnonzero(measure_longest_edges(vertices[faces]) > edge)
        if not len(long):
            return vertices, faces, origin
        vertices, faces, parent = bisect_faces(vertices, faces, long)
        kept = near.touches(vertices[faces])
        faces, origin = faces[kept], origin[parent[kept]]
