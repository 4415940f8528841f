"""The skin of the part cut into cells, and which of them the scan shows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from damageest.artefacts import ADDED, INTACT, Flags, Floats, Ints, Mesh, Part, Scan
from damageest.geometry.edges import list_edges
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours, pick_one_per_cube
from damageest.geometry.refinement import cut_into_cells
from damageest.geometry.scan_field import ScanField

MOST_CELLS = 20_000
"""Cells that the skin is cut into, about; more where the part has more triangles than this."""
LEAST_AREA = 0.25
"""Area in squares of a cell's edge below which a triangle is not cut."""
NEIGHBOURS = 6
"""Scan points that the local spacing is measured from: a disc with six points has 1.25 spacings as radius."""
AVERAGED = 6
"""Scan points that the mean distance of a cell is taken of."""
MARGIN, NARROW_MARGIN = 1.15, 0.7
"""Width in reaches of the margin that is removed at the edge of seen skin, since it lies beyond the last points: the
one that gives the right area, and one that leaves all skin that may be seen, as that beside a lost thin wall."""
TURNED_AWAY = 0.09
"""Cosine of the angle between skin and the way to a scanner position below which it does not show the skin."""
MOST_REACHES = 5000
"""Places at which the local spacing is measured."""
FACING = 1.5
"""Weight of a difference of normals, in reaches: points on the far side of a thin wall do not show the near side."""

SPARSE = 1 / 16
"""Largest radius, in diagonals of the part, of the skin that one point stands for. Points that lie farther apart show
only the places where they are."""


@dataclass(frozen=True, eq=False)
class SkinCells:
    """The skin as F triangles of similar size: ``mesh``; ``parent`` (F,): the part's triangle that each is a piece of;
    ``edge``: the length that no edge of a cell exceeds."""

    mesh: Mesh
    parent: Ints
    edge: float

    @cached_property
    def centres(self) -> Floats:
        """(F,3) the centres of the cells."""
        return np.asarray(self.mesh.triangles.mean(axis=1))

    @cached_property
    def areas(self) -> Floats:
        """(F,) the areas of the cells."""
        return self.mesh.face_areas

    @property
    def normals(self) -> Floats:
        """(F,3) the outward unit normals of the cells."""
        return self.mesh.face_normals

    @cached_property
    def neighbours(self) -> Ints:
        """(K,2) pairs of cells that share an edge."""
        edges = list_edges(self.mesh.faces)
        code = edges[:, 0] * len(self.mesh.vertices) + edges[:, 1]
        order = np.argsort(code, kind="stable")
        same = np.flatnonzero(np.diff(code[order]) == 0)
        return np.stack([order[same] // 3, order[same + 1] // 3], axis=1)

    def label_connected(self, chosen: Flags) -> Ints:
        """(F,) the number, from 0, of the connected region of each chosen cell; -1 for the others."""
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        pairs = self.neighbours[chosen[self.neighbours].all(axis=1)]
        count = len(chosen)
        links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
        label = np.full(count, -1, np.int64)
        component = connected_components(links, directed=False)[1][chosen]
        label[chosen] = np.unique(component, return_inverse=True)[1]
        return label


def cut_skin(part: Part, spacing: float) -> SkinCells:
    """Cuts the part's skin into cells about as large as three spacings of the scan."""
    edge = max(3 * min(spacing, SPARSE * part.diagonal), 2.2 * float(np.sqrt(part.area / MOST_CELLS)))
    mesh, parent = cut_into_cells(part, edge, LEAST_AREA * edge**2)
    return SkinCells(mesh, parent, edge)


def find_seen(cells: SkinCells, field: ScanField) -> tuple[Flags, Flags, Floats]:
    """Whether the scan shows each cell (F,); whether it perhaps does (F,), at the edge of what it shows; and the mean
    signed distance (F,) of the points on it, NaN without points.

    A cell is seen where an intact point lies within the local spacing of the points, or added metal covers it. Points
    count for skin that faces as the skin nearest to them. The area that a point stands for reaches beyond the edge of
    what was scanned; it is removed again.
    """
    part, aligned, tolerance = field.part, field.aligned, field.tolerance
    count = len(cells.areas)
    intact = np.flatnonzero(field.label == INTACT)
    seen, perhaps, mean = np.zeros(count, bool), np.zeros(count, bool), np.full(count, np.nan)
    if len(intact):
        # more than some points for each cell would show nothing more
        apart = max(0.35 * max(tolerance, aligned.spacing), cells.edge / 6)
        chosen = intact[pick_one_per_cube(aligned.points[intact], apart)]
        # the places on the skin below the points: how far they are from it does not matter here
        facing, points = field.find_normals(chosen), field.find_feet(chosen)
        reach = np.minimum(_measure_reach(points, cells.centres), SPARSE * part.diagonal)
        usual = float(np.median(reach))
        reach = np.minimum(reach, 3 * usual) + cells.edge / 3
        weight = FACING * usual
        among = np.concatenate([points, weight * facing], axis=1)
        asked = find_nearby(cells.centres, points, float(reach.max()))
        places = np.concatenate([cells.centres[asked], weight * cells.normals[asked]], axis=1)
        gap, index = find_neighbours(places, AVERAGED, among, float(reach.max()) * 1.001)
        seen[asked] = gap[:, 0] <= reach[asked]
        near = np.isfinite(gap)
        distance = np.append(field.distance[chosen], 0.0)[index]  # the index of a missing neighbour is the last
        mean[asked] = np.where(near, distance, 0.0).sum(axis=1) / np.maximum(near.sum(axis=1), 1)
        seen, perhaps = _trim_edges(cells, seen, usual + cells.edge / 3, weight)
        seen &= ~_faces_away(cells, aligned)
    covered = _find_covered(cells, field, max(2 * tolerance, 1.5 * aligned.spacing))
    mean[~perhaps] = np.nan
    return seen | covered, perhaps | covered, mean


def _measure_reach(points: Floats, places: Floats) -> Floats:
    """Radius (F,) about each place that holds `NEIGHBOURS` of the points, measured at the nearest of some of them."""
    some = points[:: max(1, len(points) // MOST_REACHES)]
    radius = find_neighbours(some, NEIGHBOURS + 1, points)[0][:, -1]
    return np.asarray(radius[find_neighbours(places, 1, some)[1][:, 0]])


def _faces_away(cells: SkinCells, aligned: Scan) -> Flags:
    """Which cells (F,) face away from all scanner positions; none where a point's position is not known."""
    away = np.zeros(len(cells.areas), bool)
    if aligned.viewpoints is None or aligned.view is None or (aligned.view < 0).any():
        return away
    away[:] = True
    for viewpoint in aligned.viewpoints:
        way = viewpoint - cells.centres
        away &= np.einsum("ij,ij->i", way, cells.normals) < TURNED_AWAY * np.linalg.norm(way, axis=1)
    return away


def _trim_edges(cells: SkinCells, seen: Flags, reach: float, weight: float) -> tuple[Flags, Flags]:
    """The seen cells (F,) with small gaps filled, and without the margin by which they reach beyond the points: that of
    `MARGIN`, and that of `NARROW_MARGIN`."""
    bare = cells.label_connected(~seen)
    if not (bare >= 0).any():
        return seen, seen
    size = np.bincount(bare[bare >= 0], weights=cells.areas[bare >= 0])
    small = size < 4 * reach**2
    open_ = (bare >= 0) & ~small[np.maximum(bare, 0)]
    filled = ~open_
    if not open_.any():
        return filled, filled
    places = np.concatenate([cells.centres, weight * cells.normals], axis=1)
    gap = np.zeros(len(seen))
    gap[filled] = find_neighbours(places[filled], 1, places[open_], MARGIN * reach)[0][:, 0]
    return gap > MARGIN * reach, gap > NARROW_MARGIN * reach


def _find_covered(cells: SkinCells, field: ScanField, reach: float) -> Flags:
    """Which cells (F,) lie under added metal: an added point is above them, about as far as it is from the skin."""
    added = np.flatnonzero(field.label == ADDED)
    covered = np.zeros(len(cells.areas), bool)
    if not len(added):
        return covered
    added = added[pick_one_per_cube(field.points[added], 0.5 * reach)]
    gap, index = find_neighbours(cells.centres, 1, field.points[added])
    index = added[index[:, 0]]
    way = field.points[index] - cells.centres
    above = np.einsum("ij,ij->i", way, cells.normals) > 0.5 * gap[:, 0]
    covered[above & (gap[:, 0] < field.distance[index] + reach)] = True
    return covered
