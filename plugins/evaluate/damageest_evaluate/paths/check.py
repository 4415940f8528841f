"""Checks of a path that share nothing with the planner: does the nozzle touch anything, does a pass cross itself?

The distance between the meshes of nozzle and metal is that of manifold3d. The planner takes it from FCL and from a
formula.
"""

from __future__ import annotations

import numpy as np
from damageest_paths.frames import make_frame
from manifold3d import Manifold, OpType

from damageest.artefacts import DepositPath, Floats, Ints, Solid
from damageest.geometry.solids import to_manifold
from damageest.geometry.transforms import turn_to_axis
from damageest.geometry.vectors import normalise

FAR = 2.0
"""Bead widths beyond which the distance need not be known."""


def measure_nozzle(path: DepositPath, metal: Solid, step: float) -> float:
    """The least distance between nozzle and metal over all moves; 0 where they overlap.

    The poses are ``step`` apart at most, as any point of the nozzle moves. Where the nozzle is farther from the metal
    than four steps, they are a quarter of that distance apart; so nowhere in between is it nearer than three quarters
    of the distance that was measured.
    """
    origin = metal.bounds.mean(axis=0)
    return _measure(path, np.arange(len(path.points) - 1), to_manifold(metal, origin), origin, step)


def measure_built(path: DepositPath, step: float) -> float:
    """As `measure_nozzle`, of the beads that were laid before: those of earlier layers, and on the way to a pass those
    of its own layer too, unless the pass is the first of it."""
    origin = path.points.mean(axis=0)
    layers = path.part * (path.layer.max(initial=0) + 1) + path.layer
    least = np.inf
    built = Manifold()
    for layer in dict.fromkeys(layers.tolist()):
        moves = np.flatnonzero(layers[1:] == layer)
        if not built.is_empty():
            least = min(least, _measure(path, moves, built, origin, step))
        own = np.flatnonzero(path.on & (layers == layer))
        if not len(own):
            continue
        beads = Manifold.batch_boolean([_draw_bead(path, int(k), origin) for k in own], OpType.Add)
        later = moves[~path.on[moves + 1] & (path.number[moves + 1] > path.number[own[0]])]
        least = min(least, _measure(path, later, beads, origin, step))
        built += beads
    return least


def _draw_bead(path: DepositPath, k: int, origin: Floats) -> Manifold:
    """The bead of a move: what is between two discs as high as the layer."""
    turn = make_frame(path.normals[k], np.zeros(3)).turn
    height = float(path.heights[path.part[k] - 1])
    angle = 2 * np.pi * np.arange(16) / 16
    disc = path.width / 2 * (np.cos(angle)[:, None] * turn[0] + np.sin(angle)[:, None] * turn[1])
    rings = [end - origin + disc - down * turn[2] for end in path.points[[k - 1, k]] for down in (0.0, height)]
    return Manifold.hull_points(np.concatenate(rings))


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
            least, until = min(least, gap), far[k] + gap / 4
    return least


def _list_poses(path: DepositPath, run: Ints, step: float) -> tuple[Floats, Floats, Floats]:
    """For moves in a row: tips (N,3) of all poses, axes (N,3), and how far (N,) any point of the nozzle has moved at
    most."""
    reach = float(np.linalg.norm(path.nozzle.vertices + np.array([0.0, 0.0, path.standoff]), axis=1).max())
    own = np.append(run, run[-1] + 1)
    ends, turned = path.points[own], path.axes[own]
    chord = np.linalg.norm(np.diff(turned, axis=0), axis=1)
    moves = np.linalg.norm(np.diff(ends, axis=0), axis=1) + 2 * np.arcsin(np.clip(chord / 2, 0, 1)) * reach
    counts = np.maximum(np.ceil(moves / step).astype(int), 1)
    share = np.concatenate([np.arange(count) / count for count in counts])[:, None]
    number = np.repeat(np.arange(len(counts)), counts)
    points = ends[number] + share * (ends[number + 1] - ends[number])
    axes = turned[number] + share * (turned[number + 1] - turned[number])
    axes = normalise(axes)
    far = np.repeat(np.concatenate([[0.0], np.cumsum(moves)[:-1]]), counts) + share[:, 0] * np.repeat(moves, counts)
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
