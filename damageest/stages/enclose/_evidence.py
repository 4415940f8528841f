"""What the scan says about the losses: points on them, skin that is gone, skin that is still there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from damageest.artefacts import INTACT, Deviation, Floats, Ints, Part, Samples, Scan, Sites
from damageest.stages.enclose._fit import neighbours, smoothed, subset
from damageest.stages.enclose._poisson import Grid

Flags = NDArray[np.bool_]

import os
SURE, CLEAR, FREE = [float(x) for x in os.environ.get("SCF","0.5,1.3,1.2").split(",")]


@dataclass(frozen=True, eq=False)
class Found:
    """In the part's frame: ``points`` (M,3) on the losses with the ``label`` of their site and the outward normal ``skin``
    of the face nearest to each; ``lost`` (L,3) skin samples without a sound scan point; ``kept`` (K,3) sound skin pushed
    outward, with ``kept_normals``."""

    points: Floats
    label: Ints
    skin: Floats
    lost: Floats
    kept: Floats
    kept_normals: Floats
    noise: float
    fine: float


@dataclass(frozen=True, eq=False)
class Group:
    """Losses that are solved together: ``members`` of Found.points, ``lost`` skin (L,3), the ``sites`` they belong to."""

    points: Floats
    members: Ints
    lost: Floats
    sites: tuple[int, ...]

    def oriented(self, found: Found, grid: Grid) -> tuple[Floats, Floats, Floats]:
        """Points (N,3), normals (N,3) toward the lost side or the void, and areas (N,) for the solve on a grid."""
        near = np.flatnonzero(grid.inside(found.points))
        raw, skin = found.points[near], found.skin[near]
        if len(raw) > 60_000:
            keep = subset(raw, 0.5 * grid.cell)
            raw, skin = raw[keep], skin[keep]
        points, normals, _ = smoothed(raw, found.noise)
        keep = subset(points, 0.5 * grid.cell)
        points, normals, skin = points[keep], normals[keep], skin[keep]
        near_lost = grid.inside(found.lost)
        normals = toward_void(points, normals, skin, found.lost[near_lost], found.fine)
        kept = grid.inside(found.kept)
        all_points = np.concatenate([points, found.kept[kept]])
        all_normals = np.concatenate([normals, found.kept_normals[kept]])
        areas = np.concatenate([local_areas(points), local_areas(found.kept[kept])])
        inside = grid.inside(all_points)
        return all_points[inside], all_normals[inside], areas[inside]


def gathered(
    part: Part, aligned: Scan, deviation: Deviation, sites: Sites, samples: Samples, tolerance: float,
    band: float, push: float,
) -> Found:  # fmt: skip
    """Sorts scan and skin into damaged, lost and sound; ``band`` and ``push`` in tolerances."""
    from scipy.spatial import cKDTree

    normals = part.cross / np.maximum(np.linalg.norm(part.cross, axis=1), 1e-300)[:, None]
    near = _near(aligned.points, sites.label > 0, 40 * tolerance)
    points, label, grown = _grown(aligned, deviation, sites, near, tolerance)
    sound = near & (deviation.label == INTACT) & ~grown
    hit, face = aligned.points[sound], deviation.face[sound]

    low, high = aligned.points[near].min(axis=0), aligned.points[near].max(axis=0)
    here = ((samples.points > low - 20 * tolerance) & (samples.points < high + 20 * tolerance)).all(axis=1)
    skin, outward = samples.points[here], samples.normals[here]
    gap = _gaps(skin, outward, hit, normals[face], max(2 * tolerance, 2 * aligned.spacing))
    usual = _local_spacing(skin, hit, aligned.spacing)
    supported = gap < np.maximum(SURE * usual, tolerance)
    gone = gap > np.maximum(CLEAR * usual, 2 * tolerance)
    free = cKDTree(points).query(skin, workers=2)[0] < np.maximum(band * tolerance, FREE * usual)
    kept = supported & ~free
    pushed = _pushed(part, skin[kept], outward[kept], push * tolerance)
    return Found(
        points, label, normals[deviation.face][grown | (sites.label > 0)], skin[gone], pushed,
        outward[kept], aligned.noise, max(tolerance, aligned.spacing),
    )  # fmt: skip


def groups(found: Found, tolerance: float, spacing: float) -> Iterator[Group]:
    """Losses whose points or lost skin come within reach of one another are one group. Lost skin that belongs to no
    damaged point is none: the scanner did not see it."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    link = max(3 * tolerance, 1.5 * spacing)
    every = np.concatenate([found.points, found.lost])
    cubes = np.floor((every - every.min(axis=0)) / (link / 2)).astype(np.int64)
    cells, cube = np.unique(cubes, axis=0, return_inverse=True)
    cube = cube.reshape(-1)
    pairs = cKDTree(cells).query_pairs(2.5, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(cells), len(cells)))
    _, component = connected_components(links, directed=False)
    group = component[cube]
    of_points, of_lost = group[: len(found.points)], group[len(found.points) :]
    for number in np.unique(of_points):
        members = np.flatnonzero(of_points == number)
        labels = tuple(int(k) for k in np.unique(found.label[members]) if k > 0)
        if labels:
            yield Group(found.points[members], members, found.lost[of_lost == number], labels)


def toward_void(points: Floats, normals: Floats, skin: Floats, lost: Floats, fine: float) -> Floats:
    """Turns normals (N,3) of either sign toward the lost side.

    Smooth patches are oriented as one (a spanning tree that prefers parallel neighbours, after Hoppe et al. 1992, cut at
    sharp edges); each patch then asks the lost skin, above all where that is near, and the nominal skin above it where
    it lies shallow. Last, patches that had little to go by follow their neighbours.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
    from scipy.spatial import cKDTree

    vote = 0.1 * np.einsum("ij,ij->i", normals, skin)
    if len(lost) >= 8:
        distance, index = cKDTree(lost).query(points, k=8, workers=2)
        toward = lost[index] - points[:, None]
        toward /= np.linalg.norm(toward, axis=2, keepdims=True) + 0.1 * fine
        vote = vote + np.einsum("ij,ij->i", normals, toward.mean(axis=1)) / (1 + distance.mean(axis=1) / (4 * fine))
    _, index = neighbours(points, 13)
    count = index.shape[1] - 1
    rows, columns = np.repeat(np.arange(len(points)), count), index[:, 1:].ravel()
    dots = np.einsum("ij,ij->i", normals[rows], normals[columns])
    smooth = np.abs(dots) > 0.8
    graph = coo_array((1.001 - np.abs(dots[smooth]), (rows[smooth], columns[smooth])), shape=(len(points),) * 2)
    tree = minimum_spanning_tree(graph.tocsr())
    number, patch = connected_components(tree, directed=False)
    sign = np.ones(len(points))
    both = (tree + tree.T).tocsr()
    for start in np.unique(patch, return_index=True)[1]:
        order, before = breadth_first_order(both, start, directed=False)
        child, parent = order[1:], before[order[1:]]
        turn = np.sign(np.einsum("ij,ij->i", normals[child], normals[parent]))
        for here, there, way in zip(child.tolist(), parent.tolist(), turn.tolist(), strict=True):
            sign[here] = sign[there] * way
    total = np.bincount(patch, sign * vote, number)
    size = np.bincount(patch, minlength=number)
    sure = np.abs(total) / np.sqrt(size) > 0.05
    sign *= np.where(total < 0, -1.0, 1.0)[patch]
    agree = dots * np.abs(dots) * sign[rows] * sign[columns]
    state = sure[patch].astype(float)
    for _ in range(20):
        pull = np.bincount(rows, agree * state[columns], len(points))
        state = np.where(sure[patch], 1.0, np.tanh(pull + 0.2))
    return (sign * np.where(state < 0, -1.0, 1.0))[:, None] * normals


def local_areas(points: Floats) -> Floats:
    """Area (N,) that each of the points on a surface stands for, from its eight nearest."""
    if len(points) < 3:
        return np.full(len(points), 1e-12)
    distance, _ = neighbours(points, 9)
    count = distance.shape[1] - 1
    area = np.pi * distance[:, -1] ** 2 / count
    return np.minimum(area, 4 * np.median(area))


def _near(points: Floats, damaged: Flags, margin: float) -> Flags:
    """Which points lie in the boxes of a coarse lattice that hold damage, or beside one."""
    size = margin
    low = points.min(axis=0)
    cubes = np.floor((points - low) / size).astype(np.int64) + 1
    shape = cubes.max(axis=0) + 2
    flat = (cubes[:, 0] * shape[1] + cubes[:, 1]) * shape[2] + cubes[:, 2]
    full = np.zeros(int(np.prod(shape)), bool)
    full[np.unique(flat[damaged])] = True
    full = full.reshape(shape)
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(full, np.ones((3, 3, 3), bool)).ravel()[flat])


def _grown(
    aligned: Scan, deviation: Deviation, sites: Sites, near: Flags, tolerance: float
) -> tuple[Floats, Ints, Flags]:
    """The sites' points and their neighbours that are deeper than the noise makes likely: the rim, where the damage is
    still shallower than the tolerance."""
    from scipy.spatial import cKDTree

    deep = near & (sites.label == 0) & (deviation.distance < -max(1.5 * aligned.noise, 0.1 * tolerance))
    deep &= deviation.distance >= -tolerance * 1.0001
    candidates = np.flatnonzero(deep)
    seeds = np.flatnonzero(sites.label > 0)
    label = sites.label.astype(np.int64)
    if len(candidates):
        reach = max(2 * tolerance, 0.7 * aligned.spacing)
        distance, index = cKDTree(aligned.points[seeds]).query(
            aligned.points[candidates], distance_upper_bound=reach, workers=2
        )
        hit = np.isfinite(distance)
        label[candidates[hit]] = label[seeds[index[hit]]]
    grown = (label > 0) & (sites.label == 0)
    chosen = label > 0
    return aligned.points[chosen], label[chosen], grown


def _gaps(skin: Floats, outward: Floats, hit: Floats, hit_normals: Floats, reach: float) -> Floats:
    """Distance (S,) from each skin sample to the nearest sound point on skin of like direction; inf beyond reach x 3.

    Direction counts as a fourth to sixth coordinate, so that the far side of a thin wall does not vouch for the near one.
    """
    from scipy.spatial import cKDTree

    weight = 0.6 * reach
    tree = cKDTree(np.concatenate([hit, weight * hit_normals], axis=1))
    distance, _ = tree.query(np.concatenate([skin, weight * outward], axis=1), distance_upper_bound=3 * reach, workers=2)
    return np.asarray(distance)


def _local_spacing(skin: Floats, hit: Floats, spacing: float) -> Floats:
    """What gap (S,) between sound points is usual round each skin sample: the scan's density is uneven."""
    from scipy.spatial import cKDTree

    if len(hit) < 16:
        return np.full(len(skin), spacing)
    chosen = hit[:: max(1, len(hit) // 20_000)]
    tree = cKDTree(hit)
    usual = tree.query(chosen, k=8, workers=2)[0][:, -1]
    _, index = cKDTree(chosen).query(skin, k=min(8, len(chosen)), workers=2)
    return np.median(usual[index], axis=1)


def _pushed(part: Part, skin: Floats, outward: Floats, push: float) -> Floats:
    """The samples moved outward by ``push``, or by less where another wall stands in the way."""
    import igl

    if not len(skin):
        return skin
    origin = part.bounds.mean(axis=0)
    distance, *_ = igl.signed_distance(
        np.ascontiguousarray(skin + push * outward - origin), np.ascontiguousarray(part.vertices - origin),
        np.array(part.faces), sign_type=igl.SignedDistanceType.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
    )  # fmt: skip
    by = np.clip(0.45 * (distance + push), 0.05 * push, push)
    by = np.where(distance > 0.9 * push, push, by)
    return np.asarray(skin + by[:, None] * outward)
