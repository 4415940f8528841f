"""Checks of a path that share nothing with the planner: does the nozzle touch anything, does a pass cross itself?

The distance between the meshes of nozzle and metal is that of manifold3d. The planner takes it from FCL and from a
formula.
"""

from __future__ import annotations

import numpy as np

from damageest.artefacts import DepositPath, Floats, Solid
from damageest.geometry.solids import to_manifold
from damageest.paths.frames import make_frame
from damageest.paths.nozzle import turn_to_axis

FAR = 2.0
"""Bead widths beyond which the distance need not be known."""


def measure_nozzle(path: DepositPath, metal: Solid, step: float) -> float:
    """The least distance between nozzle and metal over all moves; 0 where they overlap.

    The poses are ``step`` apart at most, as any point of the nozzle moves. Where the nozzle is farther from the metal
    than four steps, they are a quarter of that distance apart; so nowhere in between is it nearer than three quarters
    of the distance that was measured.
    """
    poses, axes, far = _list_poses(path, step)
    origin = metal.bounds.mean(axis=0)
    body, nozzle = to_manifold(metal, origin), to_manifold(path.nozzle)
    least, until = np.inf, -np.inf
    for k in range(len(poses)):
        if far[k] < until:
            continue
        placed = nozzle.transform(np.column_stack([turn_to_axis(axes[k]), poses[k] - origin]))
        gap = float(placed.min_gap(body, FAR * path.width))
        least, until = min(least, gap), far[k] + gap / 4
    return least


def _list_poses(path: DepositPath, step: float) -> tuple[Floats, Floats, Floats]:
    """Tips (N,3) of all poses, axes (N,3), and how far (N,) any point of the nozzle has moved at most."""
    reach = float(np.linalg.norm(path.nozzle.vertices + np.array([0.0, 0.0, path.standoff]), axis=1).max())
    chord = np.linalg.norm(np.diff(path.axes, axis=0), axis=1)
    moves = path.moves[1:] + 2 * np.arcsin(np.clip(chord / 2, 0, 1)) * reach
    counts = np.maximum(np.ceil(moves / step).astype(int), 1)
    share = np.concatenate([np.arange(count) / count for count in counts])[:, None]
    number = np.repeat(np.arange(len(counts)), counts)
    points = path.points[number] + share * (path.points[number + 1] - path.points[number])
    axes = path.axes[number] + share * (path.axes[number + 1] - path.axes[number])
    axes /= np.linalg.norm(axes, axis=1)[:, None]
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
