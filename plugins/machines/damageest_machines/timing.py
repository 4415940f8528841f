"""How long a program takes, with the accelerations of the axes."""

from __future__ import annotations

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.vectors import normalise
from damageest_machines.definition import Machine
from damageest_machines.moves import Moves
from damageest_machines.positions import Positions
from damageest_machines.rotary import measure_angle


def measure_minutes(machine: Machine, moves: Moves, at: Positions, exact: Flags) -> float:
    """Minutes of all moves and waits; an estimate. Each move has the speed of its feed, or that of its slowest axis.
    Speeds rise and fall as the axes' accelerations let them. At a corner the speed is that with which a circle that
    leaves it by ``post.blend`` can be run; at ``exact`` (M,) points the machine stands."""
    turns = np.diff(at.rotary, axis=0)
    length = np.linalg.norm(np.diff(moves.points, axis=0), axis=1)
    steps = [np.abs(turns)]
    speeds, accelerations = [axis.speed for axis in machine.rotary], [axis.acceleration for axis in machine.rotary]
    if machine.robot is None:
        steps.append(np.abs(np.diff(at.linear, axis=0)))
        speeds += [axis.speed for axis in machine.linear]
        accelerations += [axis.acceleration for axis in machine.linear]
    else:
        turned = np.degrees(measure_angle(moves.axes[:-1], moves.axes[1:]))
        steps.append(np.stack([length, turned], axis=1))
        speeds += [machine.robot.speed, machine.robot.turn]
        accelerations += [machine.robot.acceleration, 4 * machine.robot.turn]
    step = np.concatenate(steps, axis=1)
    slowest = (step / np.array(speeds)).max(axis=1, initial=0.0)
    seconds = np.maximum(60 * length / moves.feed[1:], slowest)
    size = np.maximum(length, np.linalg.norm(step, axis=1))  # a move that only turns has a size too
    is_move = (size > 1e-9) & (seconds > 0)
    size, seconds = size[is_move], seconds[is_move]
    with np.errstate(divide="ignore"):
        rate = (np.array(accelerations) * size[:, None] / np.maximum(step[is_move], 1e-300)).min(axis=1)
    stops = np.logical_or.reduceat(exact[1:], np.flatnonzero(is_move)) if is_move.any() else np.empty(0, bool)
    joints = _limit_corners(np.diff(at.linear, axis=0)[is_move], rate, machine.post.blend, stops)
    waits = int((moves.on[1:] & ~moves.on[:-1]).sum()) * (machine.process.on.wait + machine.process.off.wait)
    return (float(_ramp(size, size / seconds, rate, joints).sum()) + waits) / 60


def _limit_corners(steps: Floats, rate: Floats, blend: float, stops: Flags) -> Floats:
    """The speed (M+1,) that is permitted at the ends of M moves."""
    limit = np.zeros(len(steps) + 1)
    if len(steps) < 2:
        return limit
    units = normalise(steps)
    half = np.sqrt(np.clip((1 - (units[:-1] * units[1:]).sum(axis=1)) / 2, 0, 1))  # sine of half the change
    inner = np.sqrt(np.clip(1 - half**2, 0, 1))
    speed = np.sqrt(np.minimum(rate[:-1], rate[1:]) * blend * inner / np.maximum(1 - inner, 1e-12))
    limit[1:-1] = np.where(stops[:-1], 0.0, speed)
    return limit


def _ramp(size: Floats, speed: Floats, rate: Floats, limit: Floats) -> Floats:
    """Seconds (M,) of moves of this size, speed and acceleration, with speeds at their ends up to ``limit`` (M+1,)."""
    ends = limit.copy()
    ends[1:] = np.minimum(ends[1:], speed)
    ends[:-1] = np.minimum(ends[:-1], speed)
    for k in range(len(size)):
        ends[k + 1] = min(ends[k + 1], np.sqrt(ends[k] ** 2 + 2 * rate[k] * size[k]))
    for k in range(len(size) - 1, -1, -1):
        ends[k] = min(ends[k], np.sqrt(ends[k + 1] ** 2 + 2 * rate[k] * size[k]))
    top = np.minimum(speed, np.sqrt((ends[:-1] ** 2 + ends[1:] ** 2) / 2 + rate * size))
    ramps = ((top - ends[:-1]) + (top - ends[1:])) / rate
    length = (2 * top**2 - ends[:-1] ** 2 - ends[1:] ** 2) / (2 * rate)
    return np.asarray(ramps + np.maximum(size - length, 0) / top)
