"""The moves of a program: those of the path in mm, with approach and retract, and points between where the tool
turns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from damageest.artefacts import DepositPath, Flags, Floats, Ints
from damageest.errors import StageError
from damageest_machines.definition import Machine
from damageest_machines.frames import make_transform
from damageest_machines.rotary import measure_angle, slerp

TO_MM = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8}
TURNED_BACK = -2
"""Source of a move at which a rotary axis is turned back."""
REVERSED = 170.0
"""Degrees from which on the tool axis counts as reversed within one move: no shortest turn is known there."""


@dataclass(frozen=True, eq=False)
class Moves:
    """``points`` (M,3) in mm, ``axes`` and ``normals`` (M,3) in the frame of the work offset; ``feed`` (M,) in mm a
    minute; ``on`` (M,): whether the move that ends there deposits; ``source`` (M,): the move of the path that it is or
    is a piece of, -1 for approach and retract, `TURNED_BACK` for what turns an axis back; ``is_end`` (M,): whether it
    is that move's end. ``layer``, ``number``, ``part`` (M,) and ``values`` (M,C) of channels as the path has them."""

    points: Floats
    axes: Floats
    normals: Floats
    feed: Floats
    on: Flags
    layer: Ints
    number: Ints
    part: Ints
    source: Ints
    is_end: Flags
    values: Floats

    def take(self, rows: Ints) -> Moves:
        """Some rows of it, or a row several times."""
        return Moves(**{name: value[rows] for name, value in vars(self).items()})

    def describe(self, k: int) -> str:
        """Where a move is, in words."""
        x, y, z = self.points[k]
        place = f"({x:.4g}, {y:.4g}, {z:.4g})"
        if self.source[k] == TURNED_BACK:
            return f"the way on which axes are turned back after pass {self.number[k]} of layer {self.layer[k]}"
        if self.source[k] < 0:
            return f"the {'approach' if k == 0 else 'retract'} to {place}"
        kind = "pass" if self.on[k] else "the way to pass"
        return f"{kind} {self.number[k]} of layer {self.layer[k]}, at {place}"


def make_moves(path: DepositPath, unit: str, machine: Machine) -> Moves:
    """The moves in the frame of the work offset. Raises StageError where the tool turns round within a move."""
    T = make_transform(machine.frames.part)
    factor, count = TO_MM[unit], len(path.points)
    values = np.zeros((count, 0)) if path.values is None else path.values
    moves = Moves(
        path.points * factor @ T[:3, :3].T + T[:3, 3], path.axes @ T[:3, :3].T, path.normals @ T[:3, :3].T,
        path.feed * factor, path.on, path.layer, path.number, path.part, np.arange(count), np.ones(count, bool), values,
    )  # fmt: skip
    return _cut_turns(_add_ends(moves, machine), machine.post.step)


def _add_ends(moves: Moves, machine: Machine) -> Moves:
    """With a point before the first and one behind the last, along the tool axis."""
    rows = np.concatenate([[0], np.arange(len(moves.points)), [len(moves.points) - 1]])
    found = moves.take(rows)
    points, on, source = found.points.copy(), found.on.copy(), found.source.copy()
    points[0] += machine.approach * found.axes[0]
    points[-1] += machine.retract * found.axes[-1]
    on[[0, -1]], source[[0, -1]] = False, -1
    feed = found.feed.copy()
    feed[-1] = feed[~found.on].max()
    found = replace(found, points=points, on=on, source=source, feed=feed)
    keep = np.ones(len(rows), bool)
    keep[0], keep[-1] = machine.approach > 0, machine.retract > 0
    return found.take(np.flatnonzero(keep))


def _cut_turns(moves: Moves, step: float) -> Moves:
    """With points between, on the straight line, so that the tool axis turns by ``step`` degrees at most in a move."""
    turns = np.degrees(measure_angle(moves.axes[:-1], moves.axes[1:]))
    if turns.max(initial=0.0) > REVERSED:
        k = int(turns.argmax()) + 1
        raise StageError(
            f"the tool turns round by {turns.max():.0f} degrees within one move: {moves.describe(k)}",
            "path.machine.tilt: a smaller tilt",
        )
    counts = np.concatenate([[1], np.maximum(np.ceil(turns / step - 1e-6).astype(int), 1)])
    return split_moves(moves, counts)


def split_moves(moves: Moves, counts: Ints) -> Moves:
    """Each move cut into as many equal pieces as ``counts`` (M,) says; the tool axis turns evenly."""
    if (counts == 1).all():
        return moves
    rows = np.repeat(np.arange(len(counts)), counts)
    share = np.concatenate([np.arange(1, count + 1) / count for count in counts])
    before = np.maximum(rows - 1, 0)
    found = moves.take(rows)
    points = moves.points[before] + share[:, None] * (moves.points[rows] - moves.points[before])
    is_end = (share > 1 - 1e-12) & found.is_end
    points = np.where((share > 1 - 1e-12)[:, None], moves.points[rows], points)
    axes = slerp(moves.axes[before], moves.axes[rows], share)
    axes = np.where((share > 1 - 1e-12)[:, None], moves.axes[rows], axes)
    return replace(found, points=points, axes=axes, is_end=is_end)
