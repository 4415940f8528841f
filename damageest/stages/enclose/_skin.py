"""Samples of the part's skin near the damage, and whether the scan shows points on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from damageest.artefacts import ADDED, INTACT, Flags, Floats, Ints, Part, Samples
from damageest.geometry.distance import closest_on_mesh, signed_distance
from damageest.geometry.duplicates import group_integers
from damageest.geometry.neighbourhoods import (
    find_neighbours,
    make_tree,
    pick_one_per_cube,
    query_neighbours,
)
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin_near import NearCubes
from damageest.geometry.voxels import number_cubes

CUBE = 20.0
"""Edge, in tolerances, of the cubes round the skin samples outside of which no scan point counts."""
BESIDE = 1.6
"""Distance from damaged points up to which skin is near them, in usual gaps of the scan."""
SEEN = 2.0
"""Distance to an intact point, in tolerances, up to which skin is seen however dense the scan is."""
NEARER = 0.4
"""Skin is held where an intact point is nearer than this share of the distance to the damaged points."""
FAR = 8.0
"""Distance from intact points, in edges of the cubes that these are thinned in, from which skin samples are far."""
DEEP = 3.0
"""How far deep points are from skin that is held, in gaps; those are deep that lie deeper than a gap."""


@dataclass(frozen=True, eq=False)
class DamagedPoints:
    """The damaged points of a scan of N points: ``points`` (M,3), the ``site`` (M,) of each, and its number ``index``
    (M,) in the scan. ``grown`` (N,): which of them stage `cluster` did not take for damaged."""

    points: Floats
    site: Ints
    index: Ints
    grown: Flags


@dataclass(frozen=True, eq=False)
class SkinSamples:
    """``points`` (S,3) on the part's skin round the damage, and their outward ``normals`` (S,3). ``bare`` (S,): whether
    no intact scan point is near and no added metal lies on it, though the scan is dense enough there. ``away`` (S,):
    the distance to the nearest damaged point, infinite where none is near. ``usual`` (S,): the usual gap between the
    scan's points there; far from damaged points, where intact ones are near, that of all the skin."""

    points: Floats
    normals: Floats
    bare: Flags
    away: Floats
    usual: Floats


def look_at_skin(field: ScanField, damaged: DamagedPoints, nearby: Samples, band: float) -> SkinSamples:
    """The samples ``nearby``, with what the scan shows on each. ``band``: width of the skin that is near the damaged
    points."""
    part, aligned, tolerance = field.part, field.aligned, field.tolerance
    intact = (field.label == INTACT) & ~damaged.grown
    added = field.label == ADDED
    points, normals = nearby.points, nearby.normals
    if not len(points):
        none = np.zeros(0)
        return SkinSamples(points, normals, none > 0, none, none)
    hits = NearCubes.around(points, CUBE * tolerance).holds(aligned.points)
    keep = np.flatnonzero(hits & intact)
    hit = aligned.points[keep]
    if not len(hit):
        usual = np.full(len(points), aligned.spacing)
        away = _measure_away(points, damaged.points, max(band, BESIDE * aligned.spacing))
        return SkinSamples(points, normals, np.ones(len(points), bool), away, usual)
    thin = pick_one_per_cube(hit, 0.35 * tolerance)
    hit, face = hit[thin], field.deviation.face[keep][thin]
    gaps = _UsualGaps.measure(hit, tolerance)
    away = _measure_away(points, damaged.points, max(band, BESIDE * gaps.most))
    # Skin under added metal has no scan points, but no metal is lost there: the places below the added points cover it.
    above = aligned.points[hits & added]
    if len(above):
        _, below, places = closest_on_mesh(above[pick_one_per_cube(above, 0.7 * tolerance)], part)
        hit, face = np.concatenate([hit, places]), np.concatenate([face, below])
    # The normal counts as fourth to sixth coordinate: points on the far side of a thin wall must not count here.
    weight = 1.5 * tolerance
    among, asked = (
        np.concatenate([at, weight * way], axis=1) for at, way in ((hit, part.face_normals[face]), (points, normals))
    )
    tree = make_tree(among)
    gap = query_neighbours(tree, asked, 1, SEEN * tolerance)[0][:, 0]
    is_open = ~np.isfinite(gap)
    usual = np.full(len(points), gaps.typical)
    told = np.flatnonzero(is_open | np.isfinite(away))
    usual[told] = gaps.find_at(points[told])
    clear = np.maximum(1.5 * usual[is_open], SEEN * tolerance)
    bare = np.zeros(len(points), bool)
    reach = float(clear.max(initial=0.0)) * 1.001
    bare[is_open] = query_neighbours(tree, asked[is_open], 1, reach)[0][:, 0] > clear
    return SkinSamples(points, normals, bare, away, usual)


def _measure_away(points: Floats, damaged: Floats, reach: float) -> Floats:
    """The distance (S,) to the nearest of the damaged points, infinite from ``reach`` on."""
    return find_neighbours(points, 1, damaged, reach)[0][:, 0]


def find_held(field: ScanField, damaged: Ints, skin: SkinSamples, asked: Ints) -> Flags:
    """Which of the skin samples ``asked`` (K,) an intact scan point shows to be there, though damaged points are near.

    In a sparse scan the rim lies somewhere in a gap between damaged and intact points, and skin beyond the intact ones
    is not free. Compared are distances along the skin. Beside a deep loss no skin is held: the points on its wall show
    where the rim is. ``damaged``: the numbers of the damaged points in the scan.
    """
    if not len(asked):
        return np.zeros(0, bool)
    width = float(np.median(skin.usual[asked]))
    points, distance = field.points, field.distance
    on_skin = (field.label == INTACT) & (distance >= -max(2 * field.aligned.noise, 0.1 * field.tolerance))
    on_skin[damaged] = False
    intact = np.flatnonzero(on_skin & NearCubes.around(skin.points[asked], 2 * width).holds(points))
    is_deep = -distance[damaged] >= width
    feet = field.find_feet(damaged)
    if not len(intact) or is_deep.all():
        return np.zeros(len(asked), bool)
    # The normals are further coordinates: points on the far side of a thin wall do not show this side.
    places, seen = (
        np.concatenate([at, width * way], axis=1)
        for at, way in (
            (skin.points[asked], skin.normals[asked]),
            (points[intact], field.find_normals(intact)),
        )
    )
    to_intact = find_neighbours(places, 1, seen)[0][:, 0]
    to_damaged = find_neighbours(skin.points[asked], 1, feet[~is_deep])[0][:, 0]
    held = to_intact < NEARER * to_damaged
    if is_deep.any():
        held &= ~np.isfinite(find_neighbours(skin.points[asked], 1, feet[is_deep], DEEP * width)[0][:, 0])
    return np.asarray(held)


@dataclass(frozen=True, eq=False)
class _UsualGaps:
    """The radius (K,) that holds six intact points, at intact ``points`` (K,3), one in each cube of ``edge``."""

    points: Floats
    radius: Floats
    edge: float

    @classmethod
    def measure(cls, hit: Floats, tolerance: float) -> _UsualGaps:
        """From the intact points (N,3) near the samples."""
        some = hit[pick_one_per_cube(hit, 3 * tolerance)]
        return cls(some, find_neighbours(some, 7, hit)[0][:, -1], 3 * tolerance)

    @property
    def most(self) -> float:
        return float(self.radius.max())

    @property
    def typical(self) -> float:
        return float(np.median(self.radius))

    def find_at(self, places: Floats) -> Floats:
        """The median (S,) of the radii at the points nearest to each of the places (S,3). Far from all of them, where a
        search takes longest, one place stands for those of its cube."""
        distance, index = find_neighbours(places, 6, self.points, FAR * self.edge)
        far = np.flatnonzero(~np.isfinite(distance[:, -1]))
        if len(far):
            first, cube, _ = group_integers(number_cubes(places[far], self.edge)[1])
            index[far] = find_neighbours(places[far[first]], index.shape[1], self.points)[1][cube]
        return np.asarray(np.median(self.radius[index], axis=1))


def push_outward(part: Part, skin: Floats, outward: Floats, push: float) -> Floats:
    """The samples (S,3) moved outward by ``push``, or by less where another wall of the part is near."""
    if not len(skin):
        return skin
    distance, _ = signed_distance(skin + push * outward, part)
    by = np.clip(0.45 * (distance + push), 0.05 * push, push)
    by = np.where(distance > 0.9 * push, push, by)
    return np.asarray(skin + by[:, None] * outward)
