"""Turns rotary axes back between two passes, away from the part, where they would come to a limit."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from damageest.artefacts import DepositPath, Flags, Floats, Ints
from damageest.geometry.vectors import measure_to_sphere
from damageest_machines.definition import Machine
from damageest_machines.frames import make_transform
from damageest_machines.moves import TURNED_BACK, Moves

SMALL = 1e-6
"""Degrees up to which two angles are the same."""


class Refuge(NamedTuple):
    """A ball about ``centre`` (3,), in mm in the frame of the work offset: at its ``radius`` the tool may turn to all
    sides. ``free_ends`` (K,): whether the straight way there, along the tool axis, is free from the end of each
    pass."""

    centre: Floats
    radius: float
    free_ends: Flags


def find_refuge(path: DepositPath, factor: float, machine: Machine) -> Refuge | None:
    """``factor``: mm a unit of the path. None where the path does not say what is around it."""
    if path.around is None or path.free_ends is None:
        return None
    T = make_transform(machine.frames.part)
    centre = T[:3, :3] @ path.around[:3] * factor + T[:3, 3]
    return Refuge(centre, (float(path.around[3]) + path.reach) * factor, path.free_ends)


def add_stops(moves: Moves, refuge: Refuge) -> tuple[Moves, Flags]:
    """The moves with the end of each pass, from which the tool can leave, twice; and which (M,) are the second ones."""
    ends = np.flatnonzero(moves.on[:-1] & ~moves.on[1:])
    ends = ends[refuge.free_ends[moves.number[ends] - 1]]
    rows = np.insert(np.arange(len(moves.on)), ends + 1, ends)
    is_stop = np.zeros(len(rows), bool)
    is_stop[ends + 1 + np.arange(len(ends))] = True
    found = moves.take(rows)
    fast = moves.feed[~moves.on].max(initial=moves.feed.max())
    return replace(
        found, on=found.on & ~is_stop, source=np.where(is_stop, TURNED_BACK, found.source),
        feed=np.where(is_stop, fast, found.feed),
    ), is_stop  # fmt: skip


def lead_away(moves: Moves, angles: Floats, is_stop: Flags, refuge: Refuge, step: float) -> tuple[Moves, Floats, Ints]:
    """Moves and angles (M,K) with a way out, a turn there in pieces of ``step`` degrees, and the way back, in place of
    each stop at which the angles change; other stops are left out. Third: the numbers of the turns' last moves."""
    turns = np.where(is_stop, np.abs(np.diff(angles, axis=0, prepend=angles[:1])).max(axis=1), 0.0)
    pieces = np.where(turns > SMALL, np.ceil(turns / step), 0).astype(np.int64)
    counts = np.where(is_stop, np.where(pieces > 0, pieces + 2, 0), 1)
    row = np.repeat(np.arange(len(counts)), counts)
    place = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    led, out = is_stop[row], is_stop[row] & (place <= pieces[row])
    share = np.where(led, np.minimum(place / np.maximum(pieces[row], 1), 1.0), 1.0)[:, None]
    before = np.maximum(row - 1, 0)
    turned = angles[before] + share * (angles[row] - angles[before])
    found = moves.take(row)
    points = found.points.copy()
    far = measure_to_sphere(points[out], found.axes[out], refuge.centre, refuge.radius)
    points[out] += np.maximum(far, 0.0)[:, None] * found.axes[out]
    ends = np.flatnonzero(out & (place == pieces[row]))
    return replace(found, points=points, is_end=found.is_end & ~led), turned, ends
