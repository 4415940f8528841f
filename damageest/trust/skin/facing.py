"""Points near the skin that lie on another surface: the normal of the scan there tells them from intact ones."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import INTACT, Flags, Floats, Ints, Part, Scan
from damageest.geometry.distance import signed_distance
from damageest.geometry.duplicates import group_integers
from damageest.geometry.neighbourhoods import find_nearby, find_neighbours, make_tree, query_neighbours
from damageest.geometry.scan_field import ScanField
from damageest.geometry.voxels import number_cubes

STEP = 1.25
"""How far from a point metal of the part is looked for, in tolerances."""
DEPTH = 0.35
"""Depth inside the part, in tolerances, from which there is metal on a side of a point."""
TURNED = 0.85
"""Cosine of the angle between the normals of scan and skin below which a point may lie on another surface."""
NEIGHBOURS = (12, 48)
"""Fewest and most points that a normal is fitted to."""
DEEP = 0.25
"""Share of the points of a small cube that lie deeper than most noise, from which they may lie on another surface."""
BY_CHANCE, SURE = 0.067, 3.0
"""Share of the points of skin that noise takes deeper than 1.5 of its standard deviations, and how many standard
deviations of their number more there have to be in a cube: of a few points, two are deep often enough."""
FLAT = 0.35
"""Largest thickness of a patch over its width: a patch across an edge has no clear normal."""
CHUNK = 20_000
"""Points whose neighbours are in memory at a time."""


def find_turned(field: ScanField) -> Flags:
    """Which points (N,) within the tolerance of the skin lie on a surface with metal on both of its sides as designed.

    The root of a thin wall that broke off lies within a tolerance of the wall's two faces, and the wall of a narrow
    groove within a tolerance of the skin above. At a step along the local normal of the scan, either way, the part as
    designed has metal. On intact skin one of the two places is outside.
    """
    part, aligned, distance, tolerance = field.part, field.aligned, field.distance, field.tolerance
    turned = np.zeros(len(aligned.points), bool)
    if not (aligned.spacing and len(aligned.points) > NEIGHBOURS[0]):
        return turned
    near = field.label == INTACT
    asked = np.flatnonzero(near & (distance < -max(1.5 * aligned.noise, 0.1 * tolerance)))
    asked = _drop_single(field, asked)
    for _ in range(2):  # the second round asks the neighbours of what the first one found
        if not len(asked):
            return turned
        normals, clear = _fit_normals(aligned, asked, tolerance)
        asked, normals = asked[clear], normals[clear]
        if not turned.any():
            differs = np.abs(np.einsum("ij,ij->i", normals, field.find_normals(asked))) < TURNED
            asked, normals = asked[differs], normals[differs]
        turned[asked[_is_buried(aligned.points[asked], normals, part, tolerance)]] = True
        if not turned.any():
            return turned
        found = np.flatnonzero(turned)
        reach = 2 * aligned.spacing
        around = find_nearby(aligned.points, aligned.points[found], reach)
        around = around[near[around] & ~turned[around] & (distance[around] < 0)]
        gap = find_neighbours(aligned.points[around], 1, aligned.points[found], reach)[0]
        asked = around[np.isfinite(gap).ravel()]
    return turned


def _drop_single(field: ScanField, asked: Ints) -> Ints:
    """Those of the points ``asked`` (A,) that noise alone does not explain: on another surface most points lie deep, on
    the skin a few. All where the scan is too sparse to tell.

    Points are counted in cubes of the skin below them: a border between cubes within the noise would part deep points
    from the others.
    """
    spacing = field.aligned.spacing
    edge = min(3 * spacing, 2 * field.tolerance)
    if edge < 2 * spacing or not len(asked):
        return asked
    near = field.label == INTACT
    around = np.flatnonzero(near)
    place, count = group_integers(number_cubes(field.find_feet(around), edge)[1])[1:]
    deep = np.zeros(len(near), bool)
    deep[asked] = True
    deep = deep[around]
    found = np.bincount(place[deep], minlength=len(count))
    many = (found >= DEEP * count) & (found >= BY_CHANCE * count + SURE * np.sqrt(BY_CHANCE * count))
    return np.asarray(around[deep & many[place]])


def _fit_normals(aligned: Scan, asked: Ints, tolerance: float) -> tuple[Floats, Flags]:
    """Unit normals (A,3) of the scan at some of its points, of either sign, and whether each is clear (A,)."""
    density = (1.1 / aligned.spacing) ** 2
    within = np.pi * tolerance**2 * density
    count = int(np.clip(within, *NEIGHBOURS))
    places = aligned.points[asked]
    around = find_nearby(aligned.points, places, 3 * max(tolerance, 2 * aligned.spacing))
    if within > 2 * NEIGHBOURS[1]:  # a patch of the densest points would be as thick as it is wide
        share = np.random.default_rng(17).random(len(around)) < NEIGHBOURS[1] / within
        around = around[share]
    among = aligned.points[around]
    normals, clear = np.empty((len(places), 3)), np.empty(len(places), bool)
    tree, count = make_tree(among), min(count, len(among))
    for start in range(0, len(places), CHUNK):
        own = slice(start, start + CHUNK)
        index = query_neighbours(tree, places[own], count)[1]
        patches = (among[index] - places[own, None]).astype(np.float32)
        patches -= patches.mean(axis=1, keepdims=True)
        spread, axes = np.linalg.eigh(np.matmul(patches.transpose(0, 2, 1), patches).astype(np.float64))
        width = np.sqrt(np.maximum(spread, 0))
        clear[own] = (width[:, 0] < FLAT * width[:, 1]) & (width[:, 1] > 0.2 * width[:, 2])
        normals[own] = axes[:, :, 0]
    return normals, clear


def _is_buried(points: Floats, normals: Floats, part: Part, tolerance: float) -> Flags:
    """Whether each of the points (A,3) has metal of the part as designed on both sides, along its normal (A,3)."""
    buried = np.ones(len(points), bool)
    for side in (1.0, -1.0):
        some = np.flatnonzero(buried)
        distance, _ = signed_distance(points[some] + side * STEP * tolerance * normals[some], part)
        buried[some[distance > -DEPTH * tolerance]] = False
    return buried
