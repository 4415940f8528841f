"""Angles of rotary axes for tool axes, chosen for the whole path so that none of them jumps.

The tool axis v in the frame of the part, turned into the machine's frame, is reached where T(q) v = H(q) t: T is the
product of the rotations that carry the part, H that of those that carry the tool, t the tool axis with all at 0. Both
solutions follow from the directions alone (Paden's second subproblem; Murray, Li and Sastry, "A Mathematical
Introduction to Robotic Manipulation", 1994, 3.2). Which of them, and which turn, is chosen by dynamic programming.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise
from damageest_machines.definition import Rotary

SINGULAR = np.radians(2e-4)
"""Angle between the tool axis and the rotary axis next to the part below which that axis may stand anywhere: the tool
is then off by twice the angle at most."""
TURN_BACK = 720.0**2
"""Cost of a turn at a stop, where the tool may turn to all sides."""
SAME = 1e-9
"""Square of a turn in degrees that counts as none."""
PAIRS = 200_000
"""Pairs of candidates that are looked at for jumps at once."""
TURNS = 12
"""Whole turns to each side of an axis that are looked at between its limits."""


class Choice(NamedTuple):
    """``angles`` (N,K) in degrees; ``singular`` (N,): the first axis may stand anywhere there. ``unreached``: numbers
    of the moves whose tool axis no angles within the limits reach."""

    angles: Floats
    singular: Flags
    unreached: Ints


class _Chain(NamedTuple):
    """v = R(u1, s1 q1) R(u2, s2 q2) t; ``order``: which axis of the machine the first and the second are."""

    u1: Floats
    u2: Floats
    signs: tuple[float, float]
    order: tuple[int, int]


def turn_rotary(axes: Sequence[Rotary], angles: Floats, carries: str) -> tuple[Floats, Floats]:
    """Rotations (N,3,3) and shifts (N,3) of what the axes carry, at angles (N,K) in degrees: p goes to R p + s."""
    count = len(angles)
    R, s = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3))
    for number in reversed(range(len(axes))):
        axis = axes[number]
        if axis.carries != carries:
            continue
        u = np.array(axis.direction) / np.linalg.norm(axis.direction)
        own = Rotation.from_rotvec(np.radians(angles[:, number, None]) * u).as_matrix()
        point = np.array(axis.point)
        R, s = own @ R, np.einsum("nij,nj->ni", own, s - point) + point
    return R, s


class Stops(NamedTuple):
    """``is_stop`` (N,): moves at which the axes may turn by any angles at a price. At all others the tool axis may
    leave its turn by ``loose`` degrees at most."""

    is_stop: Flags
    loose: float


def choose_angles(
    axes: Sequence[Rotary], directions: Floats, up: Floats, on: Flags, start: Floats, stops: Stops | None = None
) -> Choice:
    """Angles for tool axes ``directions`` (N,3), in the machine's frame with all axes at 0, that add up to the least
    turn, where turns while it deposits (``on``) count most; beginning near ``start`` (K,). ``up``: t. Without ``stops``
    axes may jump."""
    if len(axes) == 1:
        return _choose_one(axes[0], directions, up)
    chain = _make_chain(axes)
    found, singular, is_reached = _solve(chain, directions, up)
    values, possible = _list_candidates(axes, chain, found, singular, is_reached)
    lost = np.flatnonzero(~possible.any(axis=1))
    if len(lost):
        return Choice(np.zeros((len(directions), 2)), singular, lost)
    endless = [axis.limits is None for axis in axes]
    jumps = None if stops is None else _find_jumps(axes, values, directions, up, endless, stops.loose)
    chosen = _choose_least(values, possible, on, start, endless, None if stops is None else stops.is_stop, jumps)
    for number, axis in enumerate(axes):
        if axis.limits is None:
            first = start[number] + _wrap(chosen[0, number] - start[number])
            chosen[:, number] = first + np.concatenate([[0.0], np.cumsum(_wrap(np.diff(chosen[:, number])))])
    return Choice(chosen, singular, lost)


def find_ambiguous(axes: Sequence[Rotary], angles: Floats, directions: Floats, up: Floats) -> Ints:
    """Numbers of the moves at which a control that is given the tool axis alone, and takes the solution with the least
    turn from where it stands, would not come to ``angles`` (N,K); those where the first axis is free are left out."""
    if len(axes) < 2:
        return np.empty(0, np.int64)
    found, singular, _ = _solve(_make_chain(axes), directions, up)
    turns = np.abs(_wrap(found[1:] - angles[:-1, None])).sum(axis=2)
    nearest = found[1:][np.arange(len(turns)), turns.argmin(axis=1)]
    off = np.abs(_wrap(nearest - angles[1:])).max(axis=1)
    # from a singular place the control may begin with either
    return np.flatnonzero((off > 0.01) & ~singular[1:] & (np.ptp(turns, axis=1) > 1e-6)) + 1


def measure_turns(axes: Sequence[Rotary], angles: Floats, directions: Floats, up: Floats) -> Floats:
    """How far (N,) in degrees the tool axis leaves the shortest turn from the move before, if all axes turn evenly."""
    worst = np.zeros(len(angles))
    for share in (0.25, 0.5, 0.75):
        found = find_tool_axes(axes, angles[:-1] + share * np.diff(angles, axis=0), up)
        planned = slerp(directions[:-1], directions[1:], np.full(len(found), share))
        worst[1:] = np.maximum(worst[1:], np.degrees(measure_angle(found, planned)))
    return worst


def find_tool_axes(axes: Sequence[Rotary], angles: Floats, up: Floats) -> Floats:
    """The tool axes (N,3) with the rotary axes at angles (N,K), in the machine's frame with the part's at 0."""
    part, _ = turn_rotary(axes, angles, "part")
    tool, _ = turn_rotary(axes, angles, "tool")
    return np.asarray(np.einsum("nji,nj->ni", part, tool @ up))


def measure_angle(first: Floats, second: Floats) -> Floats:
    """Angles (N,) in radians between unit vectors (N,3), exact also where they are small."""
    return np.asarray(2 * np.arctan2(np.linalg.norm(first - second, axis=1), np.linalg.norm(first + second, axis=1)))


def slerp(first: Floats, last: Floats, share: Floats) -> Floats:
    """Unit vectors (N,3) on the shortest turns from ``first`` to ``last`` (N,3), at shares (N,) of their angles."""
    angle = measure_angle(first, last)
    sine = np.sin(angle)
    is_small = sine < 1e-9
    sine = np.where(is_small, 1.0, sine)
    a = np.where(is_small, 1 - share, np.sin((1 - share) * angle) / sine)
    b = np.where(is_small, share, np.sin(share * angle) / sine)
    found = a[:, None] * first + b[:, None] * last
    return normalise(found)


def find_order(axes: Sequence[Rotary]) -> list[int]:
    """The numbers of two axes, from the part to the bed, and on to the tool."""
    part = [k for k in (0, 1) if axes[k].carries == "part"]
    return [*part[::-1], *(k for k in (0, 1) if axes[k].carries == "tool")]


def _make_chain(axes: Sequence[Rotary]) -> _Chain:
    u = [np.array(axis.direction) / np.linalg.norm(axis.direction) for axis in axes]
    order = find_order(axes)
    signs = [-1.0 if axes[k].carries == "part" else 1.0 for k in order]
    return _Chain(u[order[0]], u[order[1]], (signs[0], signs[1]), (order[0], order[1]))


def _solve(chain: _Chain, v: Floats, t: Floats) -> tuple[Floats, Flags, Flags]:
    """Both solutions (N,2,2) in degrees, by the number of the axis in the machine; where the first axis is free (N,);
    and where there is a solution (N,)."""
    u1, u2 = chain.u1, chain.u2
    mixed, first, second = float(u1 @ u2), v @ u1, float(u2 @ t)
    alpha = (mixed * second - first) / (mixed**2 - 1)
    beta = (mixed * first - second) / (mixed**2 - 1)
    cross = np.cross(u1, u2)
    square = (1 - alpha**2 - beta**2 - 2 * alpha * beta * mixed) / (cross @ cross)
    is_reached = square > -1e-7
    gamma = np.sqrt(np.clip(square, 0, None))
    singular = measure_angle(v * np.sign(first)[:, None], np.tile(u1, (len(v), 1))) < SINGULAR
    found = np.empty((len(v), 2, 2))
    for branch, side in enumerate((1.0, -1.0)):
        z = alpha[:, None] * u1 + beta[:, None] * u2 + side * gamma[:, None] * cross
        q2 = _measure_about(np.tile(t, (len(v), 1)), z, u2)
        q1 = np.where(singular, 0.0, _measure_about(z, v, u1))
        found[:, branch, chain.order[0]] = np.degrees(q1) * chain.signs[0]
        found[:, branch, chain.order[1]] = np.degrees(q2) * chain.signs[1]
    return found, singular, is_reached


def _measure_about(start: Floats, end: Floats, axis: Floats) -> Floats:
    """Angles (N,) about an axis (3,) that take vectors to others (N,3), by the right hand."""
    a = start - np.outer(start @ axis, axis)
    b = end - np.outer(end @ axis, axis)
    return np.asarray(np.arctan2(np.cross(a, b) @ axis, (a * b).sum(axis=1)))


def _list_candidates(
    axes: Sequence[Rotary], chain: _Chain, found: Floats, singular: Flags, is_reached: Flags
) -> tuple[Floats, Flags]:
    """Candidates (N,M,2) and which of them are possible (N,M): both solutions with all whole turns between the limits.
    Where the first axis is free, it stands as at the last move before, or the next after, that fixes it."""
    count, free = len(found), chain.order[0]
    known = np.flatnonzero(~singular)
    sources = [found]
    if len(known) and singular.any():
        before = known[np.clip(np.searchsorted(known, np.arange(count), side="right") - 1, 0, None)]
        after = known[np.clip(np.searchsorted(known, np.arange(count)), None, len(known) - 1)]
        sources = []
        for near in (before, after):
            for swapped in (False, True):
                own = found.copy()
                value = found[near][:, ::-1, free] if swapped else found[near][:, :, free]
                own[:, :, free] = np.where(singular[:, None], value, own[:, :, free])
                sources.append(own)
        sources = sources if singular.any() else [found]
    values = np.concatenate(sources, axis=1)
    possible = np.repeat(is_reached[:, None], values.shape[1], axis=1)
    for number, axis in enumerate(axes):
        if axis.limits is None:
            values[..., number] = _wrap(values[..., number])
            continue
        low, high = axis.limits
        base = _wrap(values[..., number])
        turns = [k for k in range(-TURNS, TURNS + 1) if low - 180 <= 360 * k <= high + 180]
        values = np.concatenate([values] * len(turns), axis=1)
        values[..., number] = np.concatenate([base + 360.0 * k for k in turns], axis=1)
        possible = np.concatenate([possible] * len(turns), axis=1)
        possible &= (values[..., number] >= low - 1e-6) & (values[..., number] <= high + 1e-6)
    keep = possible.any(axis=0)
    return values[:, keep], possible[:, keep]


def _find_jumps(
    axes: Sequence[Rotary], values: Floats, directions: Floats, up: Floats, endless: Sequence[bool], loose: float
) -> Flags:
    """Whether (N-1,M,M) the tool axis, from a candidate of a move to one of the next, leaves its turn by more than
    ``loose`` degrees halfway."""
    turns = values[1:, None] - values[:-1, :, None]
    for number in np.flatnonzero(endless):
        turns[..., number] = _wrap(turns[..., number])
    rows, old, new = np.nonzero(np.abs(turns).max(axis=3) > loose)
    found = np.zeros(turns.shape[:3], bool)
    for start in range(0, len(rows), PAIRS):
        row, a, b = (column[start : start + PAIRS] for column in (rows, old, new))
        halfway = find_tool_axes(axes, values[row, a] + turns[row, a, b] / 2, up)
        planned = slerp(directions[row], directions[row + 1], np.full(len(row), 0.5))
        found[row, a, b] = np.degrees(measure_angle(halfway, planned)) > loose
    return found


def _choose_least(
    values: Floats,
    possible: Flags,
    on: Flags,
    start: Floats,
    endless: Sequence[bool],
    is_stop: Flags | None,
    jumps: Flags | None,
) -> Floats:
    """The candidate (N,2) of each move with the least sum of squared turns; ``endless``: axes without limits. With
    ``jumps`` (N-1,M,M) those turns are forbidden, but at the moves ``is_stop`` (N,)."""
    heavy = np.where(on, 1e3, 1.0)
    cost = _cost(values[0] - start, endless) * 1e-3
    cost = np.where(possible[0], cost, np.inf)
    came = np.zeros(values.shape[:2], np.int64)
    for k in range(1, len(values)):
        turns = _cost(values[k][None] - values[k - 1][:, None], endless)
        if is_stop is not None and is_stop[k]:
            step = np.where(turns < SAME, 0.0, TURN_BACK + turns)
        else:
            step = heavy[k] * turns if jumps is None else np.where(jumps[k - 1], np.inf, heavy[k] * turns)
        total = cost[:, None] + step
        came[k] = total.argmin(axis=0)
        cost = np.where(possible[k], total[came[k], np.arange(total.shape[1])], np.inf)
    at = int(cost.argmin())
    chosen = np.empty((len(values), 2))
    for k in range(len(values) - 1, -1, -1):
        chosen[k] = values[k, at]
        at = int(came[k, at])
    return chosen


def _cost(turns: Floats, endless: Sequence[bool]) -> Floats:
    parts = [_wrap(turns[..., k]) if endless[k] else turns[..., k] for k in range(2)]
    return np.asarray(parts[0] ** 2 + parts[1] ** 2)


def _wrap(angle: Floats) -> Floats:
    """Degrees from -180 up to 180."""
    return np.asarray((angle + 180.0) % 360.0 - 180.0)


def _choose_one(axis: Rotary, directions: Floats, up: Floats) -> Choice:
    """The angles of a single rotary axis, which can reach axes of one cone only."""
    u = np.array(axis.direction) / np.linalg.norm(axis.direction)
    sign = -1.0 if axis.carries == "part" else 1.0
    angle = sign * np.degrees(_measure_about(np.tile(up, (len(directions), 1)), directions, u))
    found = np.degrees(np.unwrap(np.radians(angle)))
    missed = measure_angle(find_tool_axes([axis], found[:, None], up), directions) > np.radians(0.001)
    if axis.limits is not None:
        found = found - 360 * np.round((found.mean() - sum(axis.limits) / 2) / 360)
        missed |= (found < axis.limits[0]) | (found > axis.limits[1])
    return Choice(found[:, None], np.zeros(len(found), bool), np.flatnonzero(missed))
