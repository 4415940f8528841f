"""The angles of a machine's rotary axes for all moves, and the moves that turn an axis back at its limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Floats
from damageest.errors import StageError
from damageest_machines.definition import Machine, Rotary
from damageest_machines.frames import make_transform
from damageest_machines.moves import Moves
from damageest_machines.rotary import Stops, choose_angles, find_tool_axes, measure_turns
from damageest_machines.turning_back import Refuge, add_stops, lead_away

STRAIGHT = 1e-6
"""How far the tool axis of a machine without rotary axes may be off its z."""
LOOSE = 1.5
"""Multiple of ``post.step`` by which the tool axis may leave its turn between two points."""


class Rotated(NamedTuple):
    """The moves, with those that turn axes back; ``rotary`` (M,K): angles in degrees; ``notes``: what the user is
    told."""

    moves: Moves
    rotary: Floats
    notes: tuple[str, ...]


def turn_axes(machine: Machine, moves: Moves, refuge: Refuge | None) -> Rotated:
    """Raises StageError where the tool axis cannot be reached, or an axis would have to jump where it cannot be turned
    back. ``refuge``: where it can; None: nowhere."""
    base = make_transform(machine.frames.work)[:3, :3]
    directions = moves.axes @ base.T
    home = np.array([machine.home.get(axis.name, 0.0) for axis in machine.rotary])
    if not machine.follows:
        if machine.robot is None:
            _require_upright(machine, moves, directions)
        return Rotated(moves, np.tile(home, (len(directions), 1)), ())
    flat = np.array(machine.robot.flat if machine.robot else (0.0, 0.0, 1.0))
    flat = flat / np.linalg.norm(flat)
    found = choose_angles(machine.rotary, directions, flat, moves.on, home)
    if len(found.unreached):
        k = int(found.unreached[0])
        x, y, z = directions[k]
        raise StageError(
            f"{len(found.unreached)} of {len(directions)} tool axes are not reached by {_name(machine.rotary)} within "
            f"their limits, the first ({x:.3f}, {y:.3f}, {z:.3f}): {moves.describe(k)}",
            "path.machine.tilt: a smaller tilt, another frames.work of the machine, or another path.direction",
        )
    off = measure_turns(machine.rotary, found.angles, directions, flat)
    rotated = Rotated(moves, found.angles, ())
    if off.max() > LOOSE * machine.post.step:
        other = None
        if refuge is not None and len(machine.rotary) == 2:
            other = _turn_back(machine, moves, refuge, home, flat, base)
        if other is None:
            raise _describe_jump(machine, moves, found.angles, off)
        rotated = other
    return rotated._replace(notes=(*rotated.notes, *_list_slow(machine, rotated.moves, rotated.rotary)))


def _require_upright(machine: Machine, moves: Moves, directions: Floats) -> None:
    tilts = np.linalg.norm(directions - [0, 0, 1], axis=1)
    if tilts.max(initial=0.0) > STRAIGHT:
        k = int(tilts.argmax())
        raise StageError(
            f"{machine.name} has no rotary axes, but the tool is tilted by "
            f"{np.degrees(2 * np.arcsin(min(tilts[k] / 2, 1))):.1f} degrees: {moves.describe(k)}",
            "path.axes: 3, or a machine with rotary axes",
        )


def _turn_back(
    machine: Machine, moves: Moves, refuge: Refuge, home: Floats, flat: Floats, base: Floats
) -> Rotated | None:
    """The moves with ways away from the part, on which axes are turned back; None where that does not help. ``base``
    (3,3): turns from the work offset to the machine."""
    loose = LOOSE * machine.post.step
    stopping, is_stop = add_stops(moves, refuge)
    found = choose_angles(machine.rotary, stopping.axes @ base.T, flat, stopping.on, home, Stops(is_stop, loose))
    led, rotary, ends = lead_away(stopping, found.angles, is_stop, refuge, machine.post.step)
    axes = find_tool_axes(machine.rotary, rotary, flat) @ base
    led = replace(led, axes=np.where(led.is_end[:, None], led.axes, axes))
    if measure_turns(machine.rotary, rotary, led.axes @ base.T, flat).max() > loose:
        return None
    where = ", ".join(f"{led.number[k]}" for k in ends[:5]) + (", ..." if len(ends) > 5 else "")
    note = (
        f"{_name(machine.rotary)} are turned back {len(ends)} times before their limits: after pass {where} the tool "
        "leaves along its axis, turns outside, and returns"
    )
    return Rotated(led, rotary, (note,))


def _describe_jump(machine: Machine, moves: Moves, angles: Floats, off: Floats) -> StageError:
    k = int(off.argmax())
    was, now = ("/".join(f"{value:.1f}" for value in angles[j]) for j in (k - 1, k))
    return StageError(
        f"{_name(machine.rotary)} would have to jump from {was} to {now} degrees, and the tool would "
        f"leave its axis by {off[k]:.0f} degrees: {moves.describe(k)}",
        "wider limits of the rotary axes, home nearer to the other end of them, or a part set up otherwise",
    )


def _list_slow(machine: Machine, moves: Moves, angles: Floats) -> list[str]:
    notes = []
    for number, axis in enumerate(machine.rotary):
        turns = np.abs(np.diff(angles[:, number], prepend=angles[0, number]))
        length = np.linalg.norm(np.diff(moves.points, axis=0, prepend=moves.points[:1]), axis=1)
        planned = 60 * length / moves.feed
        slow = moves.on & (turns / axis.speed > 1.5 * planned) & (turns > machine.post.step)
        if slow.any():
            k = int(np.where(slow, turns / axis.speed - planned, 0.0).argmax())
            notes.append(
                f"{slow.sum()} of {len(slow)} moves deposit slower than planned, because {axis.name} turns near the "
                f"singular axis: by {turns[k]:.0f} degrees within {length[k]:.3g} mm, {turns[k] / axis.speed:.2g} s "
                f"instead of {planned[k]:.2g} s: {moves.describe(k)}"
            )
    return notes


def _name(axes: Sequence[Rotary]) -> str:
    return " and ".join(axis.name for axis in axes)
