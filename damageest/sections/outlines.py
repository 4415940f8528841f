"""The outlines of a part in a plane, and how far the scan is from them.

Scan points within a thin slab are moved into the plane along the skin nearest to them, so that a wall that is not
square to the plane gives no error. All is done in the coordinates of the plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints, Mesh
from damageest.artefacts.sections import SectionContour
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.neighbourhoods import make_tree, query_neighbours
from damageest.geometry.solids import to_manifold
from damageest.geometry.vectors import normalise
from damageest.sections.planes import Place

SLAB, WINDOW = 2.0, 1.5
"""Half the thickness of the slab, and half the width of the window of a station along the outline, in spacings."""
STEP = 0.25
"""Distance between stations, in spacings."""
MOST_STATIONS, FEWEST_STATIONS = 4000, 96
"""Stations of an outline."""
FEWEST_POINTS = 4
"""Points that a station needs."""
BEYOND = 0.2
"""Distance of a station from the last point, in half windows, up to which a line is continued beyond it."""
STEEP = 0.9
"""Sine of the angle between plane and skin below which points of the skin say nothing about its outline."""
CORNER = np.radians(35.0)
"""Turn of an outline from which a station is a corner."""
STRAY = 5.0
"""Standard deviations from the median of its neighbours beyond which a point is stray."""
REFITS = 2
"""How often points far from the lines are left out and these fitted again."""
NEIGHBOURS = 15
"""Points along the outline of which that median is taken."""


@dataclass(frozen=True, eq=False)
class Loop:
    """A closed outline: K stations ``places`` (K,2), counter-clockwise round metal, ``lengths`` (K+1,) along it up to
    each and to the first again, and outward unit ``normals`` (K,2). ``corners`` (C,): numbers of stations at which it
    turns sharply."""

    places: Floats
    lengths: Floats
    normals: Floats
    corners: Ints

    @property
    def length(self) -> float:
        return float(self.lengths[-1])


@dataclass(frozen=True, eq=False)
class FlatScan:
    """Points of the scan in the plane: ``points`` (N,2); the ``loop`` (N,) nearest to each, ``at`` (N,) how far along
    it, and ``distance`` (N,) outside it. ``slab``: of what thickness."""

    points: Floats
    loop: Ints
    at: Floats
    distance: Floats
    slab: float


class Offsets(NamedTuple):
    """Of points: the nearest of the outlines (N,), how far ``at`` (N,) is along it, the ``distance`` (N,) outside it,
    the nearest place ``foot`` (N,2) there, and its outward unit ``normal`` (N,2)."""

    loop: Ints
    at: Floats
    distance: Floats
    foot: Floats
    normal: Floats


def cut_part(part: Mesh, place: Place) -> list[Floats]:
    """The outlines (K,2) of a watertight mesh in a plane, counter-clockwise round metal; the longest first.

    Raises ValueError where manifold3d rejects the mesh.
    """
    origin = part.bounds.mean(axis=0)
    turn = np.stack([place.along, place.out, place.across])
    body = to_manifold(part, origin).transform(np.column_stack([turn, turn @ (origin - place.origin)]))
    loops = [np.asarray(loop, np.float64) for loop in body.slice(0.0).to_polygons()]
    loops = [_drop_repeated(loop) for loop in loops]
    loops = [loop for loop in loops if len(loop) > 2]
    return sorted(loops, key=lambda loop: -float(np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1).sum()))


def _drop_repeated(loop: Floats) -> Floats:
    gap = np.linalg.norm(loop - np.roll(loop, 1, axis=0), axis=1)
    kept: Floats = loop[gap > 1e-9 * max(float(np.ptp(loop, axis=0).max(initial=0.0)), 1e-300)]
    return kept


def make_loop(corners: Floats, step: float) -> Loop:
    """The outline with stations no farther apart than about ``step``; its ``corners`` (K,2) are among them."""
    edges = np.roll(corners, -1, axis=0) - corners
    size = np.linalg.norm(edges, axis=1)
    step = float(np.clip(step, size.sum() / MOST_STATIONS, size.sum() / FEWEST_STATIONS))
    parts = np.maximum(np.ceil(size / step - 1e-9), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(corners)), parts)
    share = (np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[edge]
    places = corners[edge] + share[:, None] * edges[edge]
    direction = normalise(np.roll(places, -1, axis=0) - places)
    bisector = normalise(direction + np.roll(direction, 1, axis=0))
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1))])
    turn = np.einsum("ij,ij->i", direction, np.roll(direction, 1, axis=0))
    return Loop(
        places, lengths, np.stack([bisector[:, 1], -bisector[:, 0]], axis=1), np.flatnonzero(turn < np.cos(CORNER))
    )


def measure_offsets(points: Floats, loops: list[Loop]) -> Offsets:
    """Where points (N,2) are on outlines, and how far outside."""
    places = np.concatenate([loop.places for loop in loops])
    owner = np.repeat(np.arange(len(loops)), [len(loop.places) for loop in loops])
    first = np.concatenate([[0], np.cumsum([len(loop.places) for loop in loops])])
    normals = np.concatenate([loop.normals for loop in loops])
    near = query_neighbours(make_tree(places), points, 1)[1][:, 0]
    loop = owner[near]
    count = np.diff(first)[loop]
    own = near - first[loop]
    best = np.full(len(points), np.inf)
    at, foot, side = np.zeros(len(points)), np.zeros((len(points), 2)), np.zeros((len(points), 2))
    for back in (1, 0):
        start = first[loop] + (own - back) % count
        end = first[loop] + (own - back + 1) % count
        way = places[end] - places[start]
        size = np.einsum("ij,ij->i", way, way)
        share = np.clip(np.einsum("ij,ij->i", points - places[start], way) / np.maximum(size, 1e-300), 0, 1)
        place = places[start] + share[:, None] * way
        gap = np.linalg.norm(points - place, axis=1)
        # at a corner the two edges may disagree on the side; the bisector of both decides
        inner = (share > 0) & (share < 1)
        facing = np.where(inner[:, None], np.stack([way[:, 1], -way[:, 0]], axis=1), normals[near])
        nearer = gap < best
        best[nearer], foot[nearer], side[nearer] = gap[nearer], place[nearer], facing[nearer]
        at[nearer] = share[nearer] * np.sqrt(size[nearer])
        at[nearer] += _start_lengths(loops, loop, start - first[loop])[nearer]
    sign = np.where(np.einsum("ij,ij->i", points - foot, side) < 0, -1.0, 1.0)
    return Offsets(loop, at, sign * best, foot, normalise(side))


def _start_lengths(loops: list[Loop], loop: Ints, station: Ints) -> Floats:
    found = np.zeros(len(loop))
    for number, each in enumerate(loops):
        own = loop == number
        found[own] = each.lengths[station[own]]
    return found


def flatten_scan(points: Floats, spacing: float, part: Mesh, place: Place, loops: list[Loop], reach: float) -> FlatScan:
    """The scan ``points`` (N,3) near a plane, in it. Those farther than ``reach`` outside the outlines are left
    out: they belong to what the part stands on."""
    slab = SLAB * spacing
    off = (points - place.origin) @ place.across
    near = points[np.abs(off) <= slab]
    flat, off = place.project(near)
    if len(near):
        normals = part.face_normals[closest_on_mesh(near, part).face]
        steep = normals @ place.across
        in_plane = normals - steep[:, None] * place.across
        usable = np.abs(steep) < STEEP
        # along the skin, as steeply as it goes, into the plane
        way = (off * steep / np.maximum(1 - steep**2, 1e-9))[:, None] * in_plane
        flat = (flat + np.stack([way @ place.along, way @ place.out], axis=1))[usable]
    if not len(flat):
        nothing = np.zeros(0)
        return FlatScan(flat, np.zeros(0, np.int64), nothing, nothing, slab)
    found = measure_offsets(flat, loops)
    kept = found.distance <= reach
    return FlatScan(flat[kept], found.loop[kept], found.at[kept], found.distance[kept], slab)


def compare(loop: Loop, at: Floats, distance: Floats, half: float) -> SectionContour:
    """How far the scan is outside an outline at its stations: a straight line is fitted to the points within ``half``
    of the station along the outline, on its side of corners. Stations that have too few, or lie beyond them, have none;
    a corner has the mean of both sides."""
    order = np.argsort(at, kind="stable")
    at, distance = at[order], distance[order]
    kept = ~_find_stray(distance)
    at, distance = at[kept], distance[kept]
    if not len(at):
        nothing = np.zeros(len(loop.places))
        return SectionContour(loop.places, loop.normals, np.full(len(nothing), np.nan), nothing, nothing)
    stations, apart = loop.lengths[:-1], 4 * half
    corners = stations[loop.corners]

    def place(where: Floats, side: Literal["left", "right"], turn: int = 0) -> Floats:
        """Lengths with a gap at each corner that no window spans. A corner itself is on one of its sides."""
        edge = np.searchsorted(corners, where, side=side) + turn * len(corners)
        return np.asarray(where + turn * loop.length + apart * edge)

    places = np.concatenate([place(at, "right", turn) for turn in (-1, 0, 1)])
    distance = np.tile(distance, 3)
    for _ in range(REFITS):  # the wall of a step, as at an edge that is too short, is no part of either side
        off = np.nan_to_num(np.abs(distance - fit_stations(places, distance, places, half)[0]))
        kept = off <= _limit_stray(off)
        places, distance = places[kept], distance[kept]
    value, error, count = fit_stations(places, distance, place(stations, "right"), half)
    if len(corners):
        before = fit_stations(places, distance, place(corners, "left"), half)
        value[loop.corners] = (value[loop.corners] + before[0]) / 2
        error[loop.corners] = np.hypot(error[loop.corners], before[1]) / 2
        count[loop.corners] += before[2]
    return SectionContour(loop.places, loop.normals, value, error, count)


def fit_stations(at: Floats, values: Floats, stations: Floats, half: float) -> tuple[Floats, Floats, Floats]:
    """Values (K,) of local straight lines at stations (K,), their standard errors and the numbers of points.

    ``at`` (N,), in order, are the places of ``values`` (N,). NaN where a station has too few points, or lies beyond the
    last by more than `BEYOND` of ``half``.
    """
    low, high = np.searchsorted(at, stations - half), np.searchsorted(at, stations + half, side="right")
    middle = float(at.mean()) if len(at) else 0.0
    x = at - middle

    def total(of: Floats) -> Floats:
        sums = np.concatenate([[0.0], np.cumsum(of)])
        return np.asarray(sums[high] - sums[low])

    here = np.searchsorted(at, stations)
    before, after = (low < here), (here < high)
    ends = np.concatenate([[-np.inf], at, [np.inf]])
    nearest = np.minimum(stations - ends[here], ends[here + 1] - stations)
    count = (high - low).astype(np.float64)
    n = np.maximum(count, 1)
    mean_x, mean_v = total(x) / n, total(values) / n
    spread = np.maximum(total(x**2) - n * mean_x**2, 0.0)
    mixed = total(x * values) - n * mean_x * mean_v
    flat = spread <= (0.05 * half) ** 2 * n
    slope = np.where(flat, 0.0, mixed / np.where(flat, 1.0, spread))
    off = stations - middle - mean_x
    rest = np.maximum(total(values**2) - n * mean_v**2 - slope * mixed, 0.0) / np.maximum(n - 2, 1)
    error = np.sqrt(rest * (1 / n + np.where(flat, 0.0, off**2 / np.where(flat, 1.0, spread))))
    known = (count >= FEWEST_POINTS) & ((before & after) | (nearest <= BEYOND * half))
    value = np.where(known, mean_v + slope * off, np.nan)
    return value, np.where(known, error, 0.0), count


def _find_stray(distance: Floats) -> Flags:
    """Which of the distances (N,), in order along the outline, are far from the median of their neighbours."""
    from scipy.ndimage import median_filter

    if len(distance) < NEIGHBOURS:
        return np.zeros(len(distance), bool)
    off = np.abs(distance - median_filter(distance, size=NEIGHBOURS, mode="wrap"))
    return np.asarray(off > _limit_stray(off))


def _limit_stray(off: Floats) -> Floats:
    """Above which of the differences (N,), in order along the outline, a point is stray: by those of its neighbours,
    since in a crater they are larger, and by those of all."""
    from scipy.ndimage import median_filter

    local = median_filter(off, size=2 * NEIGHBOURS + 1, mode="wrap")
    return np.asarray(STRAY * 1.4826 * np.maximum(np.maximum(local, np.median(off)), 1e-12))
