"""A path as a program for one machine: angles, frames and positions of all axes, checked against its limits.

What the machine cannot run is an error, so that no program is written that would stop, turn over or touch.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from damageest.artefacts import DepositPath, Flags
from damageest.stages.export import PathSettings
from damageest_machines.definition import Command, Machine
from damageest_machines.moves import Moves
from damageest_machines.positions import Positions


class Step(NamedTuple):
    """What comes next in the program: a ``note`` (its ``text``), a ``line`` of the machine file, a ``wait`` of so many
    ``seconds``, or the ``move`` with this ``number``."""

    what: Literal["note", "line", "wait", "move"]
    number: int = 0
    text: str = ""
    seconds: float = 0.0


@dataclass(frozen=True, eq=False)
class Program:
    """``moves``: in the frame of the work offset. ``at``: axes and frames of the machine at each of them. ``name`` of
    the program; ``title`` of job and site, in ASCII. ``exact`` (M,): whether the machine has to stop at the point.
    ``minutes``: of all moves and waits, with accelerations. ``notes``: what the user is told."""

    machine: Machine
    path: DepositPath
    settings: PathSettings
    moves: Moves
    at: Positions
    name: str
    title: str
    exact: Flags
    minutes: float
    notes: tuple[str, ...]

    def find_wait(self, k: int) -> float:
        """Seconds that the tool waits at the end of a move for the beads beside to cool down."""
        source = int(self.moves.source[k])
        if self.path.dwell is None or source < 0 or not self.moves.is_end[k]:
            return 0.0
        return float(self.path.dwell[source])

    def list_steps(self) -> Iterator[Step]:
        """All that the program does between its first and its last move, in order. Channels are set before the
        deposition is switched on, and where they change; it is on for the moves that deposit, and for no other."""
        process, moves = self.machine.process, self.moves
        layer: tuple[int, int] = (0, 0)
        given: dict[str, float] = {}
        for k in range(len(moves.points)):
            place = int(moves.part[k]), int(moves.layer[k])
            if place != layer:
                layer = place
                yield Step("note", text=f"part {place[0]} layer {place[1]}")
            was_on = k > 0 and bool(moves.on[k - 1])
            if was_on and not moves.on[k]:
                yield from _switch(process.off)
            if moves.on[k]:
                for name, value in zip(self.path.channels, moves.values[k].tolist(), strict=True):
                    if given.get(name) != value:
                        given[name] = value
                        channel = process.channels[name]
                        text = f"{value * channel.scale + channel.offset:.{channel.decimals}f}"
                        yield Step("line", text=channel.line.replace("{value}", text))
            if moves.on[k] and not was_on:
                yield from _switch(process.on)
            yield Step("move", k)
            if (waited := self.find_wait(k)) > 0:
                yield Step("wait", seconds=waited)
        if len(moves.points) and moves.on[-1]:
            yield from _switch(process.off)


def _switch(command: Command) -> Iterator[Step]:
    yield from (Step("line", text=line) for line in command.lines)
    if command.wait:
        yield Step("wait", seconds=command.wait)


def find_exact(on: Flags) -> Flags:
    """The points (M,) at which deposition is switched, or that are the last."""
    return np.concatenate([on[1:] != on[:-1], [True]])
