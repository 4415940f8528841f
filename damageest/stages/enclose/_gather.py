"""What the scan says about the losses: points on them, skin that is gone, skin that is still there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import Deviation, Floats, Ints, Part, Samples, Scan, Sites
from damageest.geometry.local_fits import average_points
from damageest.geometry.neighbourhoods import find_neighbours, measure_local_areas, pick_one_per_cube, thin_points
from damageest.geometry.orientation import turn_toward_void
from damageest.geometry.poisson import Grid, GridValues, refine_field
from damageest.geometry.voxels import number_cubes
from damageest.stages.enclose._skin import Flags, SkinSamples, push_outward, sample_skin_near

APART = 0.75
"""Edge of the cubes that one averaged point each is made for, in cells of the surface."""

Surfels = tuple[Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class Group:
    """Losses that are solved together: smoothed ``points`` (M,3) on them with
    ``normals`` toward the lost side and ``areas``, the ``lost`` skin (L,3), the ``sites`` they belong to."""

    points: Floats
    normals: Floats
    areas: Floats
    lost: Floats
    sites: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """In the part's frame: the ``groups``, the ``skin`` with the number of the group that lost each sample in
    ``lost_by`` (-1: it is there, or nobody knows), ``kept`` (K,3) sound skin pushed outward with ``kept_normals``."""

    groups: tuple[Group, ...]
    skin: SkinSamples
    lost_by: Ints
    kept: Floats
    kept_normals: Floats
    kept_areas: Floats


def gather_groups(
    part: Part, aligned: Scan, deviation: Deviation, sites: Sites, samples: Samples, tolerance: float,
    band: float, push: float,
) -> Found:  # fmt: skip
    """Sorts scan and skin into damaged, lost and sound; ``band`` and ``push`` in tolerances."""
    from scipy.spatial import cKDTree

    points, label, grown, face = _grow_to_rim(aligned, deviation, sites, tolerance)
    skin = sample_skin_near(part, aligned, deviation, sites, grown, samples, tolerance)
    free = cKDTree(points).query(skin.points, workers=2)[0] < np.maximum(band * tolerance, 1.6 * skin.usual)
    cross = part.cross[face]
    above = cross / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)[:, None]
    groups, lost_by = _group_losses(points, above, label, skin, free, tolerance, aligned.spacing, aligned.noise)
    areas = measure_local_areas(skin.points)
    kept = np.flatnonzero((lost_by < 0) & ~free)
    moved = push_outward(part, skin.points[kept], skin.normals[kept], push * tolerance)
    return Found(groups, skin, lost_by, moved, skin.normals[kept], areas[kept])


def select_oriented(found: Found, grid: Grid) -> tuple[Floats, Floats, Floats]:
    """Points (N,3), normals (N,3) toward the lost side or the void, and areas (N,) for a solve on a grid."""
    points = np.concatenate([*(group.points for group in found.groups), found.kept])
    normals = np.concatenate([*(group.normals for group in found.groups), found.kept_normals])
    areas = np.concatenate([*(group.areas for group in found.groups), found.kept_areas])
    inside = grid.contains(points)
    return points[inside], normals[inside], areas[inside]


def cut_beyond_reach(grid: Grid, field: GridValues, found: Found, number: int, slack: float) -> GridValues:
    """The field made negative where a sound or another group's surface is nearer, by more than ``slack``, than this
    one's.

    From inside a loss, the way to any surface that does not bound it leads through one that does. So only the void
    outside the part is cut, and what the field invents far from the group.
    """
    from scipy.ndimage import distance_transform_edt

    group = found.groups[number]
    ours = np.concatenate([group.points, group.lost])
    rest = [np.concatenate([other.points, other.lost]) for k, other in enumerate(found.groups) if k != number]
    theirs = np.concatenate([found.kept, *rest])
    half = grid.coarsen()
    away = []
    for points in (ours, theirs):
        points = points[half.contains(points)]
        if not len(points):
            return field
        free = np.ones(half.shape, bool)
        free[tuple(np.rint((points - half.origin) / half.cell).astype(np.int64).T)] = False
        away.append(distance_transform_edt(free).astype(np.float32))
    cut = (away[1] - away[0]) * np.float32(half.cell) + np.float32(slack)
    # in units of the field, whose step across a surface is about a half over two cells
    cut *= np.float32(0.25 / grid.cell)
    return np.minimum(field, refine_field(cut))


def _build_surface(
    points: Floats, above: Floats, lost: Floats, lost_normals: Floats, noise: float, cell: float
) -> Surfels:
    """The points (M,3) of one group smoothed, thinned and turned toward the lost side, with the area of each.

    ``above`` (M,3): the normal of the nominal skin nearest to each; ``lost`` (L,3): samples of the skin lost with them.
    """
    points, counts, first = thin_points(points, 0.5 * cell)
    # fits overlap much further than this, so more of them would say the same again
    chosen = pick_one_per_cube(points, APART * cell)
    above = above[first][chosen]
    points, normals = average_points(points, counts, noise, chosen)
    size, chosen = cell, np.arange(len(lost))
    while len(chosen) > 5000:
        size *= 1.3
        chosen = pick_one_per_cube(lost, size)
    places = lost[chosen]
    normals = turn_toward_void(points, normals, above, places, lost_normals[chosen], measure_local_areas(places), cell)
    return points, normals, measure_local_areas(points)


def _group_losses(
    points: Floats,
    above: Floats,
    label: Ints,
    skin: SkinSamples,
    free: Flags,
    tolerance: float,
    spacing: float,
    noise: float,
) -> tuple[tuple[Group, ...], Ints]:
    """Losses whose points or lost skin come within reach of one another are one group; and for each skin sample the
    group that lost it. Skin that shows no scan point but belongs to no damaged point is not lost: the scanner did not
    see it. A few stray points of a site whose others form a group are none of their own."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    around = skin.usual[free] if free.any() else skin.usual
    link = max(3 * tolerance, 1.5 * spacing, 1.2 * float(np.quantile(around, 0.9)) if len(around) else 0.0)
    gone = np.flatnonzero(skin.gone)
    every = np.concatenate([points, skin.points[gone]])
    cell, number = number_cubes(every, link / 2)
    _, first, cube = np.unique(number, return_index=True, return_inverse=True)
    pairs = cKDTree(cell[first]).query_pairs(2.5, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(first), len(first)))
    _, component = connected_components(links, directed=False)
    group = component[cube]
    of_points, of_gone = group[: len(points)], group[len(points) :]
    found: list[Group] = []
    whole = np.bincount(label)
    lost_by = np.full(len(skin.points), -1, np.int64)
    for number in np.unique(of_points):
        members = of_points == number
        share = np.bincount(label[members], minlength=len(whole))
        labels = tuple(int(k) for k in np.flatnonzero(share > 0.05 * whole))
        if not labels:
            continue
        lost = gone[of_gone == number]
        lost_by[lost] = len(found)
        surface = _build_surface(
            points[members], above[members], skin.points[lost], skin.normals[lost], noise, 0.8 * tolerance
        )
        found.append(Group(*surface, skin.points[lost], labels))
    return tuple(found), lost_by


def _grow_to_rim(
    aligned: Scan, deviation: Deviation, sites: Sites, tolerance: float
) -> tuple[Floats, Ints, Flags, Ints]:
    """The sites' points and their neighbours that are deeper than the noise makes likely: the rim, where the damage is
    still shallower than the tolerance."""
    deep = (sites.label == 0) & (deviation.distance < -max(2 * aligned.noise, 0.1 * tolerance))
    deep &= deviation.distance >= -tolerance * 1.0001
    candidates = np.flatnonzero(deep)
    seeds = np.flatnonzero(sites.label > 0)
    label = sites.label.astype(np.int64)
    if len(candidates):
        reach = max(2 * tolerance, 0.7 * aligned.spacing)
        distance, index = find_neighbours(aligned.points[candidates], 1, aligned.points[seeds], reach)
        hit = np.isfinite(distance[:, 0])
        label[candidates[hit]] = label[seeds[index[hit, 0]]]
    grown = (label > 0) & (sites.label == 0)
    chosen = label > 0
    return aligned.points[chosen], label[chosen], grown, deviation.face[chosen]
