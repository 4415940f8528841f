"""The scan sorted for the implicit surface: points on the damage, lost skin, intact skin."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Part, Samples, Sites
from damageest.geometry.duplicates import group_integers
from damageest.geometry.neighbourhoods import (
    find_in_box,
    find_neighbours,
    measure_local_areas,
)
from damageest.geometry.poisson import Grid, GridValues, refine_field
from damageest.geometry.scan_field import ScanField
from damageest.geometry.voxels import measure_bounds, number_cubes
from damageest.stages.enclose._loss_surface import build_surface
from damageest.stages.enclose._side import find_behind
from damageest.stages.enclose._skin import BESIDE, DamagedPoints, SkinSamples, find_held, look_at_skin, push_outward

OF_SITE = 0.05
"""Share of the points of a site from which a group holds the site; a few stray ones do not."""


@dataclass(frozen=True, eq=False)
class LossGroup:
    """Losses that are solved together: smoothed ``points`` (M,3) on them with ``normals`` (M,3) toward the lost side
    and ``areas`` (M,); samples of the ``lost`` skin (L,3); the numbers of the ``sites``."""

    points: Floats
    normals: Floats
    areas: Floats
    lost: Floats
    sites: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class GatheredLosses:
    """In the part's frame: the ``groups``; samples of the intact skin, moved outward: ``intact`` (K,3) with
    ``intact_normals`` (K,3) and ``intact_areas`` (K,)."""

    groups: tuple[LossGroup, ...]
    intact: Floats
    intact_normals: Floats
    intact_areas: Floats

    @cached_property
    def surface(self) -> tuple[_Sorted, Floats, Floats]:
        """The points of all groups and of the intact skin, with normals (N,3) and areas (N,)."""
        points = np.concatenate([*(group.points for group in self.groups), self.intact])
        normals = np.concatenate([*(group.normals for group in self.groups), self.intact_normals])
        return _Sorted(points), normals, np.concatenate([*(group.areas for group in self.groups), self.intact_areas])

    @cached_property
    def places(self) -> tuple[_Sorted, Ints]:
        """The points and the lost skin of all groups, and the intact skin, with the number (N,) of the group, -1 for
        intact skin."""
        pieces = [points for group in self.groups for points in (group.points, group.lost)]
        sizes = [len(group.points) + len(group.lost) for group in self.groups]
        owner = np.repeat([*range(len(self.groups)), -1], [*sizes, len(self.intact)])
        return _Sorted(np.concatenate([*pieces, self.intact])), owner


class _Sorted:
    """Points (N,3) of which those in a small box are found without a look at all of them."""

    def __init__(self, points: Floats) -> None:
        self.points = points
        self._axis = int(np.ptp(measure_bounds(points), axis=0).argmax()) if len(points) else 0
        self._order = np.argsort(points[:, self._axis], kind="stable")
        self._along = points[self._order, self._axis]

    def find_in(self, grid: Grid) -> Ints:
        """Ascending indices of the points in a grid."""
        low = grid.origin[self._axis]
        high = low + grid.cell * grid.shape[self._axis]
        first, last = np.searchsorted(self._along, (low - grid.cell, high + grid.cell))
        some = np.sort(self._order[first:last])
        return np.asarray(some[grid.contains(self.points[some])])


@dataclass(frozen=True, eq=False)
class IntactSkin:
    """Samples of the skin that is neither lost nor near the losses: ``points`` (K,3) and outward ``normals`` (K,3), and
    ``every`` (S,3) sample, of the other skin too."""

    points: Floats
    normals: Floats
    every: Floats


def sort_losses(
    field: ScanField, sites: Sites, nearby: Samples, band: float
) -> tuple[tuple[LossGroup, ...], IntactSkin]:
    """Sorts scan points and skin samples into losses and intact skin.

    ``band``: width of skin round the damaged points that counts as neither lost nor intact, in tolerances.
    """
    damaged, near = _grow_to_rim(field, sites), band * field.tolerance
    skin = look_at_skin(field, damaged, nearby, near)
    free = skin.away < np.maximum(near, BESIDE * skin.usual)
    asked = np.flatnonzero(free & (skin.away >= near))
    free[asked[find_held(field, damaged.index, skin, asked)]] = False
    behind = find_behind(field, damaged, skin)
    free &= ~behind
    skin = replace(skin, bare=skin.bare & ~behind)
    groups, lost_by = _group_losses(field, damaged, skin, free)
    kept = np.flatnonzero((lost_by < 0) & ~free)
    return groups, IntactSkin(skin.points[kept], skin.normals[kept], skin.points)


def push_intact(
    part: Part, groups: tuple[LossGroup, ...], skin: IntactSkin, grids: Sequence[Grid], push: float
) -> GatheredLosses:
    """The groups and the intact skin that lies in one of the ``grids`` after it is moved outward by ``push``, in the
    part's unit. The distances that the move needs cost more than all else here, so the other samples are left out."""
    near = np.zeros(len(skin.points), bool)
    for grid in grids:
        high = grid.origin + grid.cell * (np.array(grid.shape) - 1)
        near[find_in_box(skin.points, grid.origin - push, high + push)] = True
    points, normals = skin.points[near], skin.normals[near]
    areas = measure_local_areas(points, skin.every)
    return GatheredLosses(groups, push_outward(part, points, normals, push), normals, areas)


def select_in_grid(gathered: GatheredLosses, grid: Grid) -> tuple[Floats, Floats, Floats]:
    """Points (N,3), normals (N,3) toward the lost side or the void, and areas (N,), of all that lies in the grid."""
    every, normals, areas = gathered.surface
    inside = every.find_in(grid)
    return every.points[inside], normals[inside], areas[inside]


def cut_beyond_reach(grid: Grid, field: GridValues, gathered: GatheredLosses, number: int, slack: float) -> GridValues:
    """The field, made negative where the intact skin or another group is nearer than group ``number`` by more than
    ``slack``.

    Inside a loss, the nearest surface always is one that bounds it. So this cuts only the void outside the part, and
    surfaces that the solution extrapolates far from the group.
    """
    from scipy.ndimage import distance_transform_edt

    half = grid.coarsen()
    every, owner = gathered.places
    inside = every.find_in(half)
    is_ours = owner[inside] == number
    distances = []
    for points in (every.points[inside[is_ours]], every.points[inside[~is_ours]]):
        if not len(points):
            return field
        free = np.ones(half.shape, bool)
        free[tuple(np.rint((points - half.origin) / half.cell).astype(np.int64).T)] = False
        distances.append(distance_transform_edt(free).astype(np.float32))
    cut = (distances[1] - distances[0]) * np.float32(half.cell) + np.float32(slack)
    # In units of the field, which changes by about a half over two cells across a surface.
    cut *= np.float32(0.25 / grid.cell)
    return np.minimum(field, refine_field(cut))


def _group_losses(
    field: ScanField, damaged: DamagedPoints, skin: SkinSamples, free: Flags
) -> tuple[tuple[LossGroup, ...], Ints]:
    """The groups; and for each skin sample (S,) the number of the group that lost it, -1 for intact and unseen skin.

    Losses whose points or lost skin are near one another are one group. Skin without scan points that is not near
    damaged points is not lost: the scanner did not see it. A few stray points of a site do not make a group.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    points, label, tolerance = damaged.points, damaged.site, field.tolerance
    above, depth = field.find_normals(damaged.index), -field.distance[damaged.index]
    around = skin.usual[free] if free.any() else skin.usual
    link = max(
        3 * tolerance, 1.5 * field.aligned.spacing, 1.2 * float(np.quantile(around, 0.9)) if len(around) else 0.0
    )
    bare = np.flatnonzero(skin.bare)
    all_points = np.concatenate([points, skin.points[bare]])
    cell, number = number_cubes(all_points, link / 2)
    first, cube, _ = group_integers(number)
    pairs = cKDTree(cell[first]).query_pairs(2.5, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(first), len(first)))
    _, component = connected_components(links, directed=False)
    group = _join_by_site(component[cube].astype(np.int64), label)
    of_points, of_bare = group[: len(points)], group[len(points) :]
    groups: list[LossGroup] = []
    sizes = np.bincount(label)
    lost_by = np.full(len(skin.points), -1, np.int64)
    for number in np.unique(of_points):
        members = of_points == number
        share = np.bincount(label[members], minlength=len(sizes))
        labels = tuple(int(k) for k in np.flatnonzero(share > OF_SITE * sizes))
        if not labels:
            continue
        lost = bare[of_bare == number]
        lost_by[lost] = len(groups)
        of_skin = skin.points[lost], skin.normals[lost]
        surface = build_surface(
            points[members], above[members], depth[members], *of_skin, field.aligned.noise, 0.8 * tolerance
        )
        groups.append(LossGroup(*surface, skin.points[lost], labels))
    return tuple(groups), lost_by


def _join_by_site(group: Ints, label: Ints) -> Ints:
    """The groups (M,) of points and skin samples, joined where they share a site: stage cluster may link points that
    lie farther apart. ``label`` (N,): the sites of the points, which come first."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, sizes = int(group.max(initial=-1)) + 1, np.bincount(label)
    pair, shared = np.unique(group[: len(label)] * len(sizes) + label, return_counts=True)
    of_group, of_site = pair // len(sizes), pair % len(sizes)
    many = shared > OF_SITE * sizes[of_site]
    ends = of_group[many], count + of_site[many]
    links = coo_array((np.ones(int(many.sum())), ends), shape=(count + len(sizes),) * 2)
    return np.asarray(connected_components(links, directed=False)[1][group], np.int64)


def _grow_to_rim(field: ScanField, sites: Sites) -> DamagedPoints:
    """The sites' points, and neighbours that lie deeper than noise explains: the rim, where the damage is shallower
    than the tolerance."""
    aligned, tolerance = field.aligned, field.tolerance
    deep = (sites.label == 0) & (field.distance < -max(2 * aligned.noise, 0.1 * tolerance))
    deep &= field.distance >= -tolerance * 1.0001
    candidates = np.flatnonzero(deep)
    seeds = np.flatnonzero(sites.label > 0)
    label = sites.label.astype(np.int64)
    if len(candidates):
        reach = max(2 * tolerance, 0.7 * aligned.spacing)
        distance, index = find_neighbours(aligned.points[candidates], 1, aligned.points[seeds], reach)
        hit = np.isfinite(distance[:, 0])
        label[candidates[hit]] = label[seeds[index[hit, 0]]]
    grown = (label > 0) & (sites.label == 0)
    chosen = np.flatnonzero(label > 0)
    return DamagedPoints(aligned.points[chosen], label[chosen], chosen, grown)
