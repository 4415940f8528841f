"""Pieces of a sheet, unrolled into planes, and what is wanted of them as regions there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.cutting import cut_triangles
from damageest.geometry.vectors import cross_corners
from damageest_paths.fill.regions import make_region
from damageest_paths.process.process import Process
from damageest_paths.sheets.floor import Floor
from damageest_paths.sheets.sheets import Grid, Sheet, SheetTree
from damageest_paths.sheets.unroll import unroll

CLIFF = np.cos(np.radians(75.0))
"""Cosine of the angle between a sheet's face and the way in which the depth grows, from which it is a cliff."""
FEW = 0.02
"""Share of a sheet that may be cliffs, or stretched too much."""
TIGHT = 0.6
"""Least ratio of a length on the sheet to that in the plane: beads are laid as much too close there."""


@dataclass(frozen=True, eq=False)
class Patch:
    """A connected piece of a sheet: ``numbers`` (V,) of its points in the sheet, ``places`` (V,2) in the plane,
    ``faces`` (F,3). ``tight``: the least ratio of a length on the surface to that in the plane; none is above 1."""

    numbers: Ints
    places: Floats
    faces: Ints
    tree: SheetTree
    tight: float

    def draw_region(self, values: Floats, process: Process) -> Any:
        """Where a field is negative that is given at the points of the whole sheet (N,), as a region of the plane."""
        own = np.clip(values[self.numbers], -1e3 * process.bead.width, 1e3 * process.bead.width)
        flat = np.column_stack([self.places, np.zeros(len(self.places))])
        vertices, faces, _, is_outside = cut_triangles(flat, self.faces, own)
        inside = faces[~is_outside]
        return make_region([vertices[loop, :2] for loop in _trace_border(inside)]).simplify(process.bead.width / 200)

    def find_direction(self, point: Floats) -> float:
        """The direction in radians, in the plane, of its place nearest to a point (3,), seen from its middle."""
        nearest = int(np.argmin(np.linalg.norm(self.tree.points - point, axis=1)))
        away = self.places[nearest] - self.places.mean(axis=0)
        return float(np.arctan2(away[1], away[0]))

    def fill_below(self, region: Any, drop: float, edge: float) -> Any:
        """What lies up to ``drop`` below a region, as a Manifold in local coordinates with edges up to ``edge``."""
        block = region.extrude(drop).refine_to_length(edge)

        def bend(places: Floats) -> Floats:
            points, _, upward = self.tree.find(np.ascontiguousarray(places[:, :2]), exact=False)
            return points + (places[:, 2:] - drop) * upward

        return block.warp_batch(bend)


def _trace_border(faces: Ints) -> list[Ints]:
    """The border of faces as closed loops of vertices, in the sense of the faces. Loops may meet in a vertex."""
    if not len(faces):
        return []
    edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).astype(np.int64)
    size = int(faces.max()) + 1
    key, back = edges[:, 0] * size + edges[:, 1], edges[:, 1] * size + edges[:, 0]
    after: dict[int, list[int]] = {}
    for start, stop in edges[~np.isin(key, back)].tolist():
        after.setdefault(start, []).append(stop)
    loops = []
    while after:
        first = node = next(iter(after))
        loop = []
        while node in after:
            loop.append(node)
            follow = after[node]
            node = follow.pop()
            if not follow:
                del after[loop[-1]]
            if node == first:
                break
        loops.append(np.array(loop, np.int64))
    return [loop for loop in loops if len(loop) > 2]


class Unrolling(NamedTuple):
    """The ``patches`` of a sheet, and the areas of what is wanted and in none of them: at ``steps``, and where it
    ``bends`` both ways so much that beads would lie far too close."""

    patches: list[Patch]
    steps: float
    bends: float


def list_patches(sheet: Sheet, grid: Grid, reach: Floats, floor: Floor, process: Process) -> Unrolling:
    """The pieces of a sheet round what is wanted of it: where ``reach`` (N,) is negative. It is torn at cliffs, and
    where it cannot be unrolled without beads far too close, if that is more than `FEW` of it."""
    used = sheet.is_found & (reach < process.bead.width + max(process.extend))
    faces = grid.faces[used[grid.faces].all(axis=1)]
    wanted = reach[faces].min(axis=1) < 0
    corners = sheet.points[faces]
    cross = cross_corners(corners)
    area = np.linalg.norm(cross, axis=1) / 2
    along = np.einsum("fi,fi->f", cross, sheet.upward[faces].sum(axis=1)) / 6
    cliff, steps = along < CLIFF * area, 0.0
    if area[wanted & cliff].sum() > FEW * area[wanted].sum():
        steps = float(area[wanted & cliff].sum())
        faces, area = faces[~cliff], area[~cliff]
    patches, bends = _unroll_pieces(sheet, floor, faces, area, reach, 2)
    return Unrolling(patches, steps, bends)


def _unroll_pieces(
    sheet: Sheet, floor: Floor, faces: Ints, area: Floats, reach: Floats, times: int
) -> tuple[list[Patch], float]:
    """The patches of faces (F,3) of a sheet with an ``area`` (F,) each, and the area of those that are wanted and in
    none. ``times``: how often what bends too much is taken out before the rest is given up."""
    patches, torn = [], 0.0
    for own in _split(faces, len(reach)):
        matters = reach[faces[own]].min(axis=1) < 0
        if not matters.any():
            continue
        patch, ratio = _make_patch(sheet, floor, faces[own], matters)
        if patch.tight >= TIGHT:
            patches.append(patch)
            continue
        even = (ratio >= TIGHT) & (times > 1)
        rest, left = _unroll_pieces(sheet, floor, faces[own[even]], area[own[even]], reach, times - 1)
        patches += rest
        torn += left + float(area[own][matters & ~even].sum())
    return patches, torn


def _split(faces: Ints, count: int) -> list[Ints]:
    """The numbers of the faces in each connected piece."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    start, stop = faces[:, [0, 1]].ravel(), faces[:, [1, 2]].ravel()
    graph = coo_matrix((np.ones(len(start)), (start, stop)), (count, count))
    _, piece = connected_components(graph, directed=False)
    owner = piece[faces[:, 0]]
    return [np.flatnonzero(owner == one) for one in np.unique(owner)]


def _make_patch(sheet: Sheet, floor: Floor, faces: Ints, matters: Flags) -> tuple[Patch, Floats]:
    """The patch of faces (F,3), of which those that ``matters`` (F,) says decide how it is scaled; and the least ratio
    (F,) of lengths on the surface to those in the plane."""
    numbers, own = np.unique(faces, return_inverse=True)
    own = own.reshape(-1, 3)
    unrolled = unroll(sheet.points[numbers], own)
    stretch = unrolled.stretch[matters]
    largest = float(np.quantile(stretch[:, 0], 1 - FEW / 4))
    tight = float(np.quantile(stretch[:, 1], FEW)) / largest
    places = unrolled.places if abs(largest - 1) < 1e-6 else unrolled.places * largest
    patch = Patch(numbers, places, own, SheetTree(sheet, floor, places, own, numbers), tight)
    return patch, unrolled.stretch[:, 1] / largest
