"""Angles of two rotary axes for tool axes, and points on a table that turns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import DepositPath, Flags, Floats, Ints

FINEST = 1.0
"""Largest turn, in degrees, of a rotary axis between two points of a table: a point 100 mm from the pivot then leaves
the straight line by 0.004 mm."""
TURN_RATE = 3600.0
"""Degrees a minute that a rotary axis turns at most between passes, where the move itself gives no longer time."""


class Turned(NamedTuple):
    """Moves for a machine: ``points`` (M,3), ``angles`` (M,2) in degrees, ``minutes`` (M,) that the move takes, and
    the number ``move`` (M,) of the path's move that it belongs to."""

    points: Floats
    angles: Floats
    minutes: Floats
    move: Ints


def find_angles(axes: Floats, rotary: str) -> Floats:
    """Angles (N,2) in degrees: of A or B, from 0 to 180, and of C, without jumps of a whole turn.

    The tool axis is Rz(C) Rx(A) z for ``rotary`` AC, and Rz(C) Ry(B) z for BC. Where it is along z, C keeps its value.
    """
    if rotary == "none" or not len(axes):
        return np.zeros((len(axes), 2))
    tilt = np.degrees(np.arctan2(np.hypot(axes[:, 0], axes[:, 1]), axes[:, 2]))
    # Rz(C) Rx(A) z = sin A (sin C, -cos C) ; Rz(C) Ry(B) z = sin B (cos C, sin C)
    x, y = (-axes[:, 1], axes[:, 0]) if rotary == "AC" else (axes[:, 0], axes[:, 1])
    turn = np.arctan2(y, x)
    known = np.flatnonzero(tilt > 1e-6)
    if not len(known):
        return np.zeros((len(axes), 2))
    held = known[np.clip(np.searchsorted(known, np.arange(len(axes)), side="right") - 1, 0, None)]
    return np.column_stack([tilt, np.degrees(np.unwrap(turn[held]))])


def turn_table(path: DepositPath, angles: Floats, rotary: str, pivot: Floats) -> Turned:
    """The moves of a machine whose table carries the part and turns about ``pivot`` (3,): first C, on it, then A or B.

    The tool stays along z. A point p of the part is at pivot + R (p - pivot) with R = Rx(-A) Rz(-C), or Ry(-B) Rz(-C).
    Moves during which an angle changes are cut so that no part of them turns by more than `FINEST`.
    """
    turns = np.abs(np.diff(angles, axis=0)).max(axis=1, initial=0.0)
    counts = np.concatenate([[1], np.maximum(np.ceil(turns / FINEST - 1e-9).astype(int), 1)])
    move = np.repeat(np.arange(len(counts)), counts)
    share = np.concatenate([np.arange(1, count + 1) / count for count in counts])[:, None]
    before = np.maximum(move - 1, 0)
    points = path.points[before] + share * (path.points[move] - path.points[before])
    turned = angles[before] + share * (angles[move] - angles[before])
    minutes = path.moves / path.feed
    idle: Flags = ~path.on | (path.moves < 1e-9)
    slow = np.concatenate([[0.0], turns]) / TURN_RATE
    minutes = np.where(idle, np.maximum(minutes, slow), minutes)
    return Turned(
        pivot + np.einsum("nij,nj->ni", _turn_part(turned, rotary), points - pivot),
        turned,
        minutes[move] / counts[move],
        move,
    )


def _turn_part(angles: Floats, rotary: str) -> Floats:
    """Rotations (N,3,3) that take the tool axis of each pair of angles (N,2), in degrees, to z."""
    from scipy.spatial.transform import Rotation

    first = Rotation.from_euler(rotary[0].replace("A", "x").replace("B", "y"), -angles[:, :1], degrees=True)
    return np.asarray((first * Rotation.from_euler("z", -angles[:, 1:], degrees=True)).as_matrix())
