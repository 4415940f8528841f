"""Checks of a path that share nothing with the planner: does the nozzle touch anything, does a pass cross itself?

The distance between nozzle and metal is that of libigl, from the middles of the nozzle's triangles, cut small, to the
metal. The planner takes it from FCL and from a formula.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import DepositPath, Floats, Ints, Mesh
from damageest.geometry.distance import SurfaceTree, is_inside
from damageest.paths.frames import make_frame
from damageest.paths.nozzle import turn_to_axis

SPREAD, LEVELS = 1.5, 6
"""Longest edge of the nozzle's triangles near its tip, in bead widths; and how often those are quartered whose distance
does not show that they are clear."""
SHARE = 0.6
"""Share of the distance that the bound below it has to reach."""
STRIDES = (256, 64, 16, 4, 1)
POSES = 64
"""Poses that are measured together."""


def cut_nozzle(path: DepositPath) -> Floats:
    """The nozzle's triangles (F,3,3), small near the tip and larger above it."""
    triangles, done = path.nozzle.triangles, []
    while len(triangles):
        height = triangles[:, :, 2].min(axis=1)
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        small = sides.max(axis=1) <= np.maximum(SPREAD * path.width, 0.5 * height)
        done.append(triangles[small])
        rest, longest = triangles[~small], sides[~small].argmax(axis=1)
        corner = [np.take_along_axis(rest, ((longest + k) % 3)[:, None, None], axis=1)[:, 0] for k in range(3)]
        half = (corner[0] + corner[1]) / 2
        triangles = np.concatenate(
            [np.stack([corner[0], half, corner[2]], axis=1), np.stack([half, corner[1], corner[2]], axis=1)]
        )
    return np.concatenate(done)


def measure_nozzle(path: DepositPath, metal: Mesh, step: float) -> tuple[float, float]:
    """The least distance between nozzle and metal over all moves: what was measured, and a bound below it.

    The poses are ``step`` apart at most, as any point of the nozzle moves. Poses are left out that cannot touch,
    judging by the distance at another and the way from there. A bound of 0 or less is no proof that the nozzle is clear. The
    distance is negative where the tip lies in metal.
    """
    poses, axes, far = _list_poses(path, step)
    centre = metal.bounds.mean(axis=0)
    tree = SurfaceTree(Mesh(metal.vertices - centre, metal.faces))
    triangles = cut_nozzle(path)
    slices = _cut_slices(triangles, path.width)
    least, bound = np.inf, np.inf
    known = np.full(len(poses), -np.inf)
    for stride in STRIDES:
        own = np.arange(0, len(poses), stride)
        own = own[known[own] == -np.inf]
        for start in range(0, len(own), POSES):
            some = own[start : start + POSES]
            low, high = _measure_some(poses[some] - centre, axes[some], triangles, slices, tree)
            known[some] = low
            least, bound = min(least, high), min(bound, float(low.min()))
        held = np.flatnonzero(known > 0)
        if len(held):
            number = np.searchsorted(held, np.arange(len(poses)), side="right")
            for near in (held[np.maximum(number - 1, 0)], held[np.minimum(number, len(held) - 1)]):
                implied = known[near] - np.abs(far - far[near])
                known = np.where((known == -np.inf) & (implied > 0), implied, known)
    if is_inside(poses[:: STRIDES[1]], metal).any():
        return -1.0, -1.0
    return least, bound


class Slices(NamedTuple):
    """Balls round slices of the nozzle: ``height`` (S,) of their middles on the axis, ``radius`` (S,); ``number`` (F,):
    the slice of each triangle."""

    height: Floats
    radius: Floats
    number: Ints


def _cut_slices(triangles: Floats, width: float) -> Slices:
    edges = width * 2.0 ** np.arange(-1, 12)
    number = np.unique(np.searchsorted(edges, triangles[:, :, 2].mean(axis=1)), return_inverse=True)[1]
    heights, radii = [], []
    for k in range(int(number.max()) + 1):
        corners = triangles[number == k].reshape(-1, 3)
        middle = (corners[:, 2].min() + corners[:, 2].max()) / 2
        heights.append(middle)
        radii.append(np.linalg.norm(corners - [0, 0, middle], axis=1).max())
    return Slices(np.array(heights), np.array(radii), number)


def _measure_some(
    tips: Floats, axes: Floats, triangles: Floats, slices: Slices, tree: SurfaceTree
) -> tuple[Floats, float]:
    """For each pose (N,) a bound below the distance, and the least distance that was measured."""
    turns = np.stack([turn_to_axis(axis) for axis in axes])
    low, upper, least = np.full(len(tips), np.inf), np.full(len(tips), np.inf), np.inf
    middles = tips[:, None] + slices.height[:, None] * axes[:, None]
    ball = tree.closest(middles.reshape(-1, 3))[0].reshape(len(tips), -1) - slices.radius
    near = ball < slices.radius
    low = np.where(near, np.inf, ball).min(axis=1)
    pose, number = np.nonzero(near[:, slices.number])
    if not len(pose):
        return low, float(low.min())
    corners = np.einsum("fcj,fij->fci", triangles[number], turns[pose]) + tips[pose][:, None]
    whose = pose
    for level in range(LEVELS + 1):
        middle = corners.mean(axis=1)
        reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        distance = tree.closest(middle)[0]
        least = min(least, float(distance.min()))
        np.minimum.at(upper, whose, np.minimum(distance, low[whose]) if level == 0 else distance)
        last = (distance - reach < SHARE * upper[whose]) & (level < LEVELS)
        np.minimum.at(low, whose[~last], (distance - reach)[~last])
        if not last.any():
            break
        a, b, c = np.moveaxis(corners[last], 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
        whose = np.tile(whose[last], 4)
    return low, least


def _list_poses(path: DepositPath, step: float) -> tuple[Floats, Floats, Floats]:
    """Tips (N,3) of all poses, axes (N,3), and the way (N,) that any point of the nozzle has moved at most."""
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
