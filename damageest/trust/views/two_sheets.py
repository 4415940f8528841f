"""Whether a scan shows two surfaces over the same skin, as of two views that do not fit together."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Solid
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.neighbourhoods import find_in_box, find_neighbours
from damageest.geometry.scan_field import ScanField
from damageest.geometry.skin import extract_ids

NEIGHBOURS = 12
"""Points looked at about each point."""
FEWEST = 3
"""Points of each of the two surfaces among them."""
LEAST_NOISE = 1 / 6
"""Noise that is reckoned with at least, in tolerances: a surface that curves is no second one."""
SEPARATE, INSIDE, EMPTY = 3.0, 1.3, 1.0
"""Distance of the middles of both, spread of each, and gap between them, in noises: at least the first and the last, at
most the second. Twelve points of one surface are split by 1.6 with a spread of 0.6."""
APART = 0.85
"""Distance of the middles of both along the skin, in radii of the neighbours, from which they lie side by side, as at
the rim of a loss. Half discs lie 1.2 apart, twice six points drawn at random 0.58."""
AMONG = 1.3
"""Mean distance of the points of one surface along the skin, in those of the other, up to which they lie among each
other. In a groove that is narrower than the neighbourhood, the upper ones lie on both sides and farther."""
SMOOTH = 0.15
"""Least share of the variance of the points' depths that a smooth surface, of second degree along the skin, leaves. Of
views that do not fit together it leaves 0.33 to 0.82 (one in ten less, one in ten more); of sparse points on fillets,
whose radius is off, 0.02 to 0.32."""
FARTHEST = 6.0
"""Distance of both in tolerances, from which they are no misplaced view: that is found by what lies outside."""
WALL = 2.5
"""Thinnest wall that may be left, in tolerances: thinner, it is a layer between two views."""
ON_SKIN = 0.5
"""Largest depth, in tolerances, of the upper surface over a site."""
FACING = 3.0
"""Weight of a difference of normals, in spacings: a thin wall has two sides."""
STRAIGHT = 0.15
"""Difference of a point's distances to the skin and to the plane of the nearest triangle, in tolerances, up to which it
lies straight over that triangle. What is nearest to an edge, as the root of a wall that is gone, lies beside it."""
LAYER = 5.0
"""Distance from the skin, in tolerances, up to which the whole scan is asked."""
FEWEST_POINTS = 25
"""Points of a site among two surfaces below which nothing is said: at the roots of walls that are gone are some."""
MOST_ASKED, ALL_ASKED = 2000, 4000
"""Points of a site, and of the whole scan, that are asked; a share is right to two percent, and to 0.2 percent."""

AGAINST = 0.12
"""Share of a site's points with another surface above them, on the skin. Of 40 scans with losses, wear and waves of
known truth one has 0.07 (a narrow groove), the others at most 0.01; views that are 1.5 tolerances and more too deep
have 0.06 to 0.4 where they overlap."""
OF_SCAN = 0.0115
"""Share of all points of a scan that lie on two surfaces, from which its views do not fit together. On the scans above
it is at most 0.006, on a shaft whose journals are worn on one side, and 0.011 on a gear whose teeth are cut along their
flanks; of 20 misplaced views 0.012 to 0.32, but for three that overlap little."""
EXPLAINED = 2.5
"""Depth of a site, in distances of the two surfaces, up to which the misplaced view explains it: where only one view
shows the skin, it lies too deep by more than it does across the view where both show it."""
MANY, EXPLAINED_BY_MANY = 0.1, 4.0
"""Share of all points on two surfaces from which the views are far apart, and the depth that they explain then. Where
both show skin that lies along the motion, the two surfaces are nearer to each other than the views are."""
MOST_COMPARED = 300_000
"""Points of a scan, chosen at random, among which these are asked: two surfaces are two in few points as well."""


class Sheets(NamedTuple):
    """``share`` of a scan's points that lie where it shows two surfaces, and how far these are ``apart``."""

    share: float = 0.0
    apart: float = 0.0

    @property
    def disagree(self) -> bool:
        """Whether they are so many that views do not fit together."""
        return self.share > OF_SCAN

    def explain(self, own: float, depth: float) -> bool:
        """Whether they explain a site: the share of its ``own`` points among them, and its typical ``depth``."""
        reach = EXPLAINED_BY_MANY if self.share > MANY else EXPLAINED
        return own > AGAINST or (self.disagree and depth < reach * self.apart)


class SheetPlaces(NamedTuple):
    """Where a scan shows two surfaces: the points ``places`` (K,), how deep the ``upper`` surface lies there (K,), and
    how far ``below`` it the other lies (K,)."""

    sheets: Sheets
    places: Ints
    upper: Floats
    below: Floats


def measure_two_sheets(field: ScanField, members: Ints, damage: Solid | None = None) -> float:
    """Share of a site's points ``members`` (M,) where the scan shows another surface above them, on the skin.

    At the rim of a loss points of both kinds lie side by side. Where two views do not fit together, or one surface was
    scanned twice with an error between, they lie in the same place. A thin wall that is left, as of a tooth cut along
    its flank, has two sides; by the ``damage`` volume, the lower one faces away from the skin above it.
    """
    if len(members) < NEIGHBOURS:
        return 0.0
    tolerance, points = field.tolerance, field.points
    margin = 3 * tolerance + 3 * field.aligned.spacing
    low, high = points[members].min(axis=0) - margin, points[members].max(axis=0) + margin
    thinned, near = _take_some(field, find_in_box(points, low, high), np.random.default_rng(0))
    step = max(1, len(members) // MOST_ASKED)
    asked = members[::step]
    is_double, upper, apart = _find_double(thinned, asked, near)
    is_double &= upper < ON_SKIN * tolerance
    if damage is not None:
        walls = is_double & (apart > WALL * tolerance)
        is_double[walls] = _faces_skin(field, asked[walls], damage)
    return float(is_double.mean()) if step * is_double.sum() >= FEWEST_POINTS else 0.0


def _faces_skin(field: ScanField, index: Ints, damage: Solid) -> Flags:
    """Whether the inner surface at each of the points (K,) faces the nearest skin, across the metal that is lost."""
    floor = extract_ids(damage, field.part)
    if not len(floor.faces) or not len(index):
        return np.ones(len(index), bool)
    _, face, _ = closest_on_mesh(field.points[index], floor)
    return np.asarray(np.einsum("ij,ij->i", floor.face_normals[face], field.find_normals(index)) > 0)


def measure_sheets(field: ScanField) -> Sheets:
    """How much of the whole scan shows two surfaces, wherever they lie."""
    return find_sheets(field).sheets


def find_sheets(field: ScanField) -> SheetPlaces:
    """Where the whole scan shows two surfaces."""
    near = np.flatnonzero(np.abs(field.distance) < LAYER * field.tolerance)
    nothing = np.empty(0)
    if len(near) < NEIGHBOURS:
        return SheetPlaces(Sheets(), near[:0], nothing, nothing)
    rng = np.random.default_rng(0)
    thinned, near = _take_some(field, near, rng)
    asked = rng.permutation(near)[:ALL_ASKED]
    is_double, upper, apart = _find_double(thinned, asked, near)
    if not is_double.any():
        return SheetPlaces(Sheets(), near[:0], nothing, nothing)
    sheets = Sheets(float(is_double.mean()), float(np.quantile(apart[is_double], 0.9)))
    return SheetPlaces(sheets, asked[is_double], upper[is_double], apart[is_double])


def _take_some(field: ScanField, near: Ints, rng: np.random.Generator) -> tuple[ScanField, Ints]:
    """At most about `MOST_COMPARED` of the points ``near`` (N,), and the field with the spacing that they have."""
    if len(near) <= MOST_COMPARED:
        return field, near
    share = MOST_COMPARED / len(near)
    spacing = float(field.aligned.spacing / np.sqrt(share))
    return replace(field, aligned=replace(field.aligned, spacing=spacing)), near[rng.random(len(near)) < share]


def _find_double(field: ScanField, asked: Ints, near: Ints) -> tuple[Flags, Floats, Floats]:
    """Which of the points ``asked`` (A,) lie among two surfaces of points of ``near`` (N,), the depth (A,) of the upper
    one and how far below it the lower one lies (A,)."""
    tolerance = field.tolerance
    noise = max(field.aligned.noise, LEAST_NOISE * tolerance)
    weight = FACING * max(field.aligned.spacing, 1e-300)
    is_asked_straight, is_near_straight = (_is_straight(field, index, STRAIGHT * tolerance) for index in (asked, near))
    near = near[is_near_straight]
    if len(near) < NEIGHBOURS:
        nothing = np.zeros(len(asked))
        return nothing > 0, nothing, nothing
    feet, own = (_find_faced_feet(field, index, weight) for index in (near, asked))
    index = find_neighbours(own, NEIGHBOURS, feet)[1]
    depth, offset = -field.distance[near][index], feet[index] - own[:, None]
    # two surfaces are split at the widest gap between the depths
    ordered = np.sort(depth, axis=1)
    gaps = np.diff(ordered, axis=1)[:, FEWEST - 1 : NEIGHBOURS - FEWEST]
    at = gaps.argmax(axis=1) + FEWEST
    rows = np.arange(len(asked))
    is_lower = depth > ((ordered[rows, at - 1] + ordered[rows, at]) / 2)[:, None]
    lower, lower_spread = _measure_spread(depth, is_lower)
    upper, upper_spread = _measure_spread(depth, ~is_lower)
    side = np.linalg.norm(_find_middle(offset, is_lower) - _find_middle(offset, ~is_lower), axis=1)
    away = np.linalg.norm(offset, axis=2)
    is_self = away < 1e-9 * weight
    near_lower, near_upper = (_measure_spread(away, kind & ~is_self)[0] for kind in (is_lower, ~is_lower))
    radius = np.sqrt(((offset - offset.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean(axis=1))
    is_double = (lower - upper > SEPARATE * noise) & (gaps.max(axis=1) > EMPTY * noise) & (side < APART * radius)
    is_double &= is_asked_straight & (np.maximum(lower_spread, upper_spread) < INSIDE * noise)
    is_double &= (near_upper < AMONG * near_lower) & (near_lower < AMONG * near_upper)
    is_double &= lower - upper < FARTHEST * tolerance
    chosen = np.flatnonzero(is_double)
    is_double[chosen] = _measure_unevenness(depth[chosen], offset[chosen, :, :3]) > SMOOTH
    return is_double, upper, lower - upper


def _measure_unevenness(depth: Floats, offset: Floats) -> Floats:
    """(K,) the share of the variance of depths (K,M) that a surface of second degree over their places leaves.
    ``offset`` (K,M,3): these, from a place among them."""
    if not len(depth):
        return np.zeros(0)
    along = offset - offset.mean(axis=1, keepdims=True)
    x, y = np.moveaxis(along @ np.moveaxis(np.linalg.svd(along, full_matrices=False)[2][:, :2], 1, 2), 2, 0)
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    height = depth - depth.mean(axis=1, keepdims=True)
    left = height[..., None] - terms @ (np.linalg.pinv(terms) @ height[..., None])
    return np.asarray((left**2).sum(axis=(1, 2)) / np.maximum((height**2).sum(axis=1), 1e-300))


def _is_straight(field: ScanField, index: Ints, most: float) -> Flags:
    """Which points lie straight over or under their nearest triangle, and not beside an edge of it."""
    corner = field.part.take_triangles(field.deviation.face[index])[:, 0]
    height = np.einsum("ij,ij->i", field.points[index] - corner, field.find_normals(index))
    return np.asarray(np.abs(height - field.distance[index]) < most)


def _measure_spread(values: Floats, chosen: Flags) -> tuple[Floats, Floats]:
    """Mean and standard deviation (N,) of the chosen (N,M) of some values (N,M)."""
    count = np.maximum(chosen.sum(axis=1), 1)
    mean = (values * chosen).sum(axis=1) / count
    return mean, np.sqrt((((values - mean[:, None]) * chosen) ** 2).sum(axis=1) / count)


def _find_middle(offset: Floats, chosen: Flags) -> Floats:
    """(N,K) the middle of the chosen (N,M) of some offsets (N,M,K)."""
    return np.asarray((offset * chosen[..., None]).sum(axis=1) / np.maximum(chosen.sum(axis=1), 1)[:, None])


def _find_faced_feet(field: ScanField, index: Ints, weight: float) -> Floats:
    """(K,6) the places on the skin below points, and the weighted normals of the skin there."""
    return np.concatenate([field.find_feet(index), weight * field.find_normals(index)], axis=1)
