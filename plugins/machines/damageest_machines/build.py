"""Builds the program of a path for a machine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from damageest.artefacts import DepositPath, Floats, Ints
from damageest.errors import StageError
from damageest.stages.export import PathSettings
from damageest_machines.angles import turn_axes
from damageest_machines.definition import Machine
from damageest_machines.moves import TO_MM, Moves, make_moves, split_moves
from damageest_machines.positions import Positions, check_kinematics, find_positions
from damageest_machines.program import Program, find_exact
from damageest_machines.rotary import turn_rotary
from damageest_machines.timing import measure_minutes
from damageest_machines.turning_back import find_refuge

CHORD = 0.005
"""How far, in mm, a point may leave its line while a table without tool centre point turns between two points."""


def build_program(path: DepositPath, settings: PathSettings, machine: Machine) -> Program:
    """Raises StageError for what the machine cannot do, or where the machine file has no command for a channel."""
    _check_channels(path, machine)
    factor = TO_MM[settings.unit]
    refuge = find_refuge(path, factor, machine)
    moves, rotary, notes = turn_axes(machine, make_moves(path, settings.unit, machine), refuge)
    standoff = path.standoff * factor
    at = find_positions(machine, moves, standoff, rotary)
    if machine.post.tcp == "table" and machine.rotary:
        moves, at = _follow_table(machine, moves, at, standoff)
    exact = find_exact(moves.on)
    minutes = measure_minutes(machine, moves, at, exact) + path.wait_minutes
    title = settings.title.encode("ascii", "replace").decode().replace("\n", " ")
    name = machine.post.program.replace("{site}", str(settings.site))
    return Program(machine, path, settings, moves, at, name, title, exact, minutes, (*notes, *at.notes))


def check_machine(machine: Machine, channels: Sequence[str]) -> None:
    """Raises StageError where no path with these channels could be run on the machine, wherever it goes."""
    _check_names(channels, machine)
    _check_table(machine)
    check_kinematics(machine)


def _check_names(channels: Sequence[str], machine: Machine) -> None:
    known = machine.process.channels
    for name in channels:
        if name not in known:
            raise StageError(
                f"the path has a channel '{name}', for which {machine.name} has no command",
                f"process.channels.{name} in the machine file, or leave it out of path.process; there are: "
                f"{', '.join(known) or 'none'}",
            )


def _check_channels(path: DepositPath, machine: Machine) -> None:
    _check_names(path.channels, machine)
    known = machine.process.channels
    for number, name in enumerate(path.channels):
        assert path.values is not None
        given = path.values[path.on, number]
        low, high = known[name].least, known[name].most
        if len(given) and (given.min() < low or given.max() > high):
            wrong = given.min() if given.min() < low else given.max()
            raise StageError(
                f"channel '{name}' would be {wrong:g}, beyond the limits of {machine.name}: {low:g} to {high:g}",
                "another value in path.process",
            )


def _check_table(machine: Machine) -> None:
    if machine.post.tcp == "table" and any(axis.carries == "tool" for axis in machine.rotary):
        raise StageError(
            f"{machine.name}: post.tcp: table needs both rotary axes in the table, but one carries the tool",
            "post.tcp: control",
        )


def _follow_table(machine: Machine, moves: Moves, at: Positions, standoff: float) -> tuple[Moves, Positions]:
    """Moves cut so that points on a table that turns stay on their lines, though the control knows nothing of it."""
    _check_table(machine)
    far = max(float(np.linalg.norm(at.linear - axis.point, axis=1).max()) for axis in machine.rotary)
    step = min(machine.post.step, float(np.degrees(2 * np.arccos(1 - min(CHORD / max(far, CHORD), 1.0)))))
    turns = np.abs(np.diff(at.rotary, axis=0)).max(axis=1, initial=0.0)
    counts = np.concatenate([[1], np.maximum(np.ceil(turns / step - 1e-6).astype(int), 1)])
    rotary = _interpolate(at.rotary, counts)
    cut = split_moves(moves, counts)
    R, _ = turn_rotary(machine.rotary, rotary, "part")
    axes = np.einsum("nji,j->ni", R @ at.base[:3, :3], np.array([0.0, 0.0, 1.0]))
    cut = replace(cut, axes=np.where(cut.is_end[:, None], cut.axes, axes))
    return cut, replace(find_positions(machine, cut, standoff, rotary), notes=at.notes)


def _interpolate(values: Floats, counts: Ints) -> Floats:
    rows = np.repeat(np.arange(len(counts)), counts)
    share = np.concatenate([np.arange(1, count + 1) / count for count in counts])[:, None]
    before = np.maximum(rows - 1, 0)
    return np.asarray(values[before] + share * (values[rows] - values[before]))
