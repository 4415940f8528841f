"""Checks of a path that share nothing with the planner: does the nozzle touch anything, does a pass cross itself?

The distance between the meshes of nozzle and metal is that of manifold3d; that between nozzle and beads is
libigl's, from places on the beads. The planner takes both from FCL and from a formula.
"""

from __future__ import annotations

import numpy as np
from damageest_paths.process.frames import make_frame
from manifold3d import Manifold

from damageest.artefacts import DepositPath, Floats, Ints, Mesh, Solid
from damageest.geometry.distance import distance_to_mesh, is_inside
from damageest.geometry.solids import to_manifold
from damageest.geometry.transforms import turn_to_axis
from damageest.geometry.vectors import normalise

FAR = 2.0
"""Bead widths beyond which the distance need not be known."""
PAIRS = 2_000_000
"""Pairs of a pose and a place on beads that are looked at at once."""


def measure_nozzle(path: DepositPath, metal: Solid, step: float) -> float:
    """The least distance between nozzle and metal over all moves; 0 where they overlap.

    The poses are ``step`` apart at most, as any point of the nozzle moves. Where the nozzle is farther from the metal
    than two steps, they are half of that distance apart; so nowhere in between is it nearer than three quarters of the
    smaller one of both distances.
    """
    origin = metal.bounds.mean(axis=0)
    return _measure(path, np.arange(len(path.points) - 1), to_manifold(metal, origin), origin, step)


def measure_built(path: DepositPath, step: float) -> float:
    """As `measure_nozzle`, of the beads that were laid before: those of earlier layers, and on the way to a pass those
    of its own layer too, unless the pass is the first of it.

    The beads are places on their tops, ``step`` apart, in the middle and at both sides. A bead's side is nearer than
    its places by half a step at most, which is taken off.
    """
    layers = path.part * (path.layer.max(initial=0) + 1) + path.layer
    surface = Mesh(path.nozzle.vertices, path.nozzle.faces)
    least = np.inf
    built = np.empty((0, 3))
    for layer in dict.fromkeys(layers.tolist()):
        moves = np.flatnonzero(layers[1:] == layer)
        own = np.flatnonzero(path.on & (layers == layer))
        tops = _list_tops(path, own, step)
        least = min(least, _measure_places(path, moves, built, surface, step))
        if len(own):
            later = moves[~path.on[moves + 1] & (path.number[moves + 1] > path.number[own[0]])]
            least = min(least, _measure_places(path, later, tops, surface, step))
        built = np.concatenate([built, tops])
    return max(least - step / 2, 0.0)


def _list_tops(path: DepositPath, own: Ints, step: float) -> Floats:
    """Places (N,3) on the tops of the beads of the moves ``own``: in the middle and at both sides."""
    if not len(own):
        return np.empty((0, 3))
    counts = np.maximum(np.ceil(path.moves[own] / step).astype(int), 1)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts])[:, None]
    move = np.repeat(own, counts)
    ahead = path.points[move] - path.points[move - 1]
    middle = path.points[move - 1] + share * ahead
    beside = path.width / 2 * normalise(np.cross(ahead, path.normals[move]), 1e-12)
    found = np.concatenate([middle, middle + beside, middle - beside])
    kept = np.unique(np.round(found / (step / 2)).astype(np.int64), axis=0, return_index=True)[1]
    return found[np.sort(kept)]


def _measure_places(path: DepositPath, moves: Ints, places: Floats, surface: Mesh, step: float) -> float:
    """The least distance between nozzle and places (N,3) over the moves (M,); 0 where one lies in it.

    First at poses `FAR` bead widths apart, then at those between that are farther than half the distance from them.
    """
    least = np.inf
    if not len(places):
        return least
    for run in np.split(moves, np.flatnonzero(np.diff(moves) != 1) + 1):
        if not len(run):
            continue
        tips, axes, far = _list_poses(path, run, 2 * step)
        found = np.full(len(tips), np.nan)
        for apart in (FAR * path.width / 2, 0.0):
            known = np.flatnonzero(~np.isnan(found))
            todo = np.isnan(found)
            if len(known):
                before = known[np.maximum(np.searchsorted(known, np.arange(len(far)), side="right") - 1, 0)]
                after = known[np.minimum(np.searchsorted(known, np.arange(len(far))), len(known) - 1)]
                todo &= np.abs(far - far[before]) > found[before] / 2
                todo &= np.abs(far - far[after]) > found[after] / 2
            elif apart > 0:
                cell = np.floor(far / apart)
                todo = np.concatenate([[True], cell[1:] != cell[:-1]])
            own = np.flatnonzero(todo)
            found[own] = _measure_poses(tips[own], axes[own], places, surface, path.width, step)
        least = min(least, float(np.nanmin(found)))
    return least


def _measure_poses(tips: Floats, axes: Floats, places: Floats, surface: Mesh, width: float, step: float) -> Floats:
    """The distances (N,) between places (M,3) and the nozzle with its tip at ``tips`` (N,3), along ``axes`` (N,3); at
    most `FAR` bead widths; 0 where a place lies in it."""
    far = FAR * width
    low, high = surface.vertices[:, 2].min() - far, surface.vertices[:, 2].max() + far
    out = float(np.hypot(surface.vertices[:, 0], surface.vertices[:, 1]).max()) + far
    found = np.full(len(tips), far)
    for first in range(0, len(tips), max(PAIRS // len(places), 1)):
        chunk = slice(first, first + max(PAIRS // len(places), 1))
        up = axes[chunk] @ places.T - np.einsum("ij,ij->i", axes[chunk], tips[chunk])[:, None]
        pose, place = np.nonzero((up > low) & (up < high))
        away = places[place] - tips[chunk][pose]
        along = up[pose, place]
        kept = np.einsum("ij,ij->i", away, away) - along**2 < out**2
        pose, away = pose[kept], away[kept]
        if not len(pose):
            continue
        turns = np.array([turn_to_axis(axis) for axis in axes[chunk]])
        turned = np.einsum("ni,nij->nj", away, turns[pose])
        gaps = distance_to_mesh(turned, surface)
        # a bead that reaches into the nozzle has a place near its surface
        near = np.flatnonzero(gaps < step)
        gaps[near[is_inside(turned[near], surface)]] = 0.0
        np.minimum.at(found, first + pose, gaps)
    return found


def _measure(path: DepositPath, moves: Ints, body: Manifold, origin: Floats, step: float) -> float:
    """The least distance between nozzle and body over the moves (M,), each from its point to the next."""
    nozzle = to_manifold(path.nozzle)
    least = np.inf
    for run in np.split(moves, np.flatnonzero(np.diff(moves) != 1) + 1):
        if not len(run):
            continue
        poses, axes, far = _list_poses(path, run, step)
        until = -np.inf
        for k in range(len(poses)):
            if far[k] < until:
                continue
            placed = nozzle.transform(np.column_stack([turn_to_axis(axes[k]), poses[k] - origin]))
            gap = float(placed.min_gap(body, FAR * path.width))
            least, until = min(least, gap), far[k] + gap / 2
    return least


def _list_poses(path: DepositPath, run: Ints, step: float) -> tuple[Floats, Floats, Floats]:
    """For moves in a row: tips (N,3) of all poses, the last one included, axes (N,3), and how far (N,) any point of the
    nozzle has moved at most."""
    own = np.append(run, run[-1] + 1)
    ends, turned = path.points[own], path.axes[own]
    chord = np.linalg.norm(np.diff(turned, axis=0), axis=1)
    moves = np.linalg.norm(np.diff(ends, axis=0), axis=1) + 2 * np.arcsin(np.clip(chord / 2, 0, 1)) * path.reach
    counts = np.maximum(np.ceil(moves / step).astype(int), 1)
    share = np.concatenate([*(np.arange(count) / count for count in counts), [1.0]])[:, None]
    number = np.append(np.repeat(np.arange(len(counts)), counts), len(counts) - 1)
    points = ends[number] + share * (ends[number + 1] - ends[number])
    axes = turned[number] + share * (turned[number + 1] - turned[number])
    axes = normalise(axes)
    far = np.concatenate([[0.0], np.cumsum(moves)[:-1]])[number] + share[:, 0] * moves[number]
    return points + path.standoff * axes, axes, far


def count_crossings(path: DepositPath) -> int:
    """How often sides of one pass properly cross others of the same pass, seen along the build direction."""
    total = 0
    for number in np.unique(path.number):
        own = np.flatnonzero(path.on & (path.number == number))
        if len(own) < 3:
            continue
        turn = make_frame(path.normals[own[0]], np.zeros(3)).turn
        start, stop = path.points[own - 1] @ turn.T[:, :2], path.points[own] @ turn.T[:, :2]
        total += _count_crossings(start, stop)
    return total


def _count_crossings(start: Floats, stop: Floats) -> int:
    a, b, c, d = start[:, None], stop[:, None], start[None], stop[None]

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        return np.asarray((q - p)[..., 0] * (r - p)[..., 1] - (q - p)[..., 1] * (r - p)[..., 0])

    tiny = 1e-9 * float(np.abs(stop - start).max()) ** 4
    across = (side(a, b, c) * side(a, b, d) < -tiny) & (side(c, d, a) * side(c, d, b) < -tiny)
    return int(np.triu(across, 2).sum())
