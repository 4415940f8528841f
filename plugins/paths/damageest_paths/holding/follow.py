"""The tool along passes on curved layers: its axis follows the layer as far as machine and obstacles permit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise
from damageest_paths.clearance.gauges import Gauge, LeastGauge
from damageest_paths.fill.regions import find_corners, find_runs
from damageest_paths.holding.reach import keep_reached
from damageest_paths.holding.steady import steady_axes
from damageest_paths.holding.sweeps import Sweeps
from damageest_paths.process.process import Pass, Process, measure_along

Z = np.array([0.0, 0.0, 1.0])
LEANS, AROUND = tuple(np.radians([20.0, 40.0, 60.0])), 8
"""Angles by which the tool leans from the layer's normal where it cannot stand upright on it, and in how many ways."""
SHARES = (0.67, 0.33, 0.0)
"""Shares of the normal's tilt that are tried."""
ROOM = 1.5
"""Multiple of the clearance that counts as room to spare."""
EVERY, LEAST, MOST = 3.0, 5, 40
"""Distance in bead widths of the points of a pass at which all ways to hold the tool are tried first, and how many they
are at least and at most."""
BEST = 6
"""Ways that are tried all along after the first, at most."""
STILL = 1e-3
"""Angle in radians between the axes at two points up to which the tool does not count as turning."""
STRAIGHT = 0.002
"""Share of a bead's width by which a pass may leave out points that lie on a straight line."""
TURN = 0.02
"""Share of the clearance by which the nozzle may move where these points are left out."""


class Run(NamedTuple):
    """A piece of a pass that the nozzle reaches: its points from ``start`` to ``stop`` (not included), the ``axes``
    (N,3) there, the least distance ``gap``, and the point and axis where it is."""

    start: int
    stop: int
    axes: Floats
    gap: float
    tightest: tuple[Floats, Floats]


def limit_tilt(axes: Floats, tilt: float) -> Floats:
    """The axes (N,3) nearest to those given that are tilted by an angle in radians against z at most."""
    flat = np.linalg.norm(axes[:, :2], axis=1)
    angle = np.minimum(np.arctan2(flat, axes[:, 2]), tilt)
    side = axes[:, :2] / np.maximum(flat, 1e-300)[:, None]
    return np.column_stack([np.sin(angle)[:, None] * side, np.cos(angle)])


def list_ways(normals: Floats, process: Process) -> list[Floats]:
    """Tool axes (N,3) along a pass that may be tried, the best first, for the layer's ``normals`` (N,3)."""
    if process.axes != 5 or process.tilt <= 0:
        return [np.tile(Z, (len(normals), 1))]
    upright = limit_tilt(normals, process.tilt)
    angle = np.arccos(np.clip(upright[:, 2], -1, 1))
    ways = [upright]
    if angle.max() > 1e-3:
        ways += [_tilt_less(upright, share * angle) for share in SHARES]
    first = np.cross(normals, [0.0, 1.0, 0.0])
    first = normalise(first, 1e-9)
    second = np.cross(normals, first)
    for lean in LEANS[: 1 if process.is_trial else None]:
        for k in range(AROUND):
            turn = 2 * np.pi * k / AROUND
            side = np.cos(turn) * first + np.sin(turn) * second
            ways.append(limit_tilt(np.cos(lean) * normals + np.sin(lean) * side, process.tilt))
    return [keep_reached(way, process.reach) for way in ways]


def _tilt_less(axes: Floats, angle: Floats) -> Floats:
    flat = np.maximum(np.linalg.norm(axes[:, :2], axis=1), 1e-300)[:, None]
    return np.column_stack([np.sin(angle)[:, None] * axes[:, :2] / flat, np.cos(angle)])


def follow_line(points: Floats, normals: Floats, parts: Sequence[Sweeps], process: Process, least: int) -> list[Run]:
    """The runs of a pass with points (N,3), N at least 2, and normals (N,3), along which the nozzle is clear.

    Between two points, point and axis change evenly, the axis not faster than the machine may turn it. The distance is
    taken so often that between two places nothing comes nearer by more than half of the process's step. ``least``:
    number of points of a run.
    """
    smooth = steady_axes(points, normals, process.turn_rate, process.bead.width)
    ways, around = list_ways(smooth, process), LeastGauge(parts)
    tried = [_measure(points, ways[0], normals, around, process, np.ones(len(points) - 1, bool))]
    if not (tried[0].gaps >= process.gap).all() and len(ways) > 1:
        for k, chosen in _choose_ways(points, normals, ways, parts, process):
            tried.append(_measure(points, ways[k], normals, around, process, chosen))
            if (tried[-1].gaps >= process.gap).all():
                tried = tried[-1:]
                break
        else:
            mixed = _mix(
                points, [one.axes for one in tried], np.array([one.gaps >= process.gap for one in tried]), process
            )
            tried.append(_measure(points, mixed, normals, around, process, np.ones(len(points) - 1, bool)))
    runs = _cut(np.array([one.gaps >= process.gap for one in tried]), max(least - 1, 1))
    found = []
    for number, start, stop in runs:
        one = tried[number]
        low = start + int(np.argmin(one.gaps[start:stop]))
        found.append(
            Run(start, stop + 1, one.axes[start : stop + 1], float(one.gaps[low]), (one.poses[low], one.turned[low]))
        )
    return found


def find_free_ways(points: Floats, normals: Floats, parts: Sequence[Sweeps], process: Process) -> Flags:
    """Whether each way to hold the tool, see `list_ways`, may be free (N,M) at points of a pass (N,3)."""
    ways = list_ways(steady_axes(points, normals, process.turn_rate, process.bead.width), process)
    return np.asarray(process.gap <= _bound_ways(points, normals, np.array(ways), parts, process).T)


def _bound_ways(points: Floats, normals: Floats, ways: Floats, parts: Sequence[Sweeps], process: Process) -> Floats:
    """An upper bound of the distance (M,N) at each point with each way (M,N,3); 0 where the tool is too oblique."""
    places = np.tile(points, (len(ways), 1))
    room = [part.clearance.bound(places, ways.reshape(-1, 3), ROOM * process.gap)[1] for part in parts]
    least = np.min(room, axis=0).reshape(len(ways), -1)
    least[[_find_oblique(axis, normals, process) for axis in ways]] = 0.0
    return np.asarray(least)


def _mix(points: Floats, ways: Sequence[Floats], free: Flags, process: Process) -> Floats:
    """Axes (N,3) that are those of the first way but where it is not free: there, and a little before and after, those
    of the free way that leans least from it. ``free``: (ways, stretches)."""
    from scipy.ndimage import maximum_filter1d

    lean = np.array([1 - np.einsum("ij,ij->i", way, ways[0]).mean() for way in ways])
    order = np.argsort(lean, kind="stable")
    rank = np.where(free[order].any(axis=0), np.argmax(free[order], axis=0), 0)
    wide = 2 * int(np.ceil(process.bead.width / process.step)) + 1
    own = order[maximum_filter1d(rank, wide)]
    axes = np.array(ways)[np.append(own, own[-1]), np.arange(len(points))]
    steady = steady_axes(points, axes, process.turn_rate, process.bead.width)
    return keep_reached(limit_tilt(steady, process.tilt), process.reach)


def _choose_ways(
    points: Floats, normals: Floats, ways: Sequence[Floats], parts: Sequence[Sweeps], process: Process
) -> list[tuple[int, Flags]]:
    """The numbers of the ways to hold the tool, each (N,3), that are worth a trial after the first, by some points of
    the pass: that which is free at most of them, then those that are free where the ones before are not. And the
    stretches (N-1,) of each that may be free: those beside a point where it is."""
    count = int(np.clip(measure_along(points)[-1] / (EVERY * process.bead.width), LEAST, MOST))
    sparse = np.unique(np.linspace(0, len(points) - 1, count).round().astype(int))
    axes = np.array([way[sparse] for way in ways])
    room = _bound_ways(points[sparse], normals[sparse], axes, parts, process)
    free, narrow = room >= process.gap, room.min(axis=1) < ROOM * process.gap
    chosen: list[int] = []
    open_ = np.ones(len(sparse), bool)
    while len(chosen) < BEST:
        worth, new = free.sum(axis=1), free[:, open_].sum(axis=1)
        worth[[0, *chosen]] = 0
        best = int(np.lexsort([np.arange(len(ways)), narrow, -worth, -new * (worth > 0)])[0])
        if not worth[best]:
            break
        chosen.append(best)
        open_ = np.asarray(~free[[0, *chosen]].any(axis=0))
    return [(k, np.repeat(free[k, :-1] | free[k, 1:], np.diff(sparse))) for k in chosen]


def _find_oblique(axes: Floats, normals: Floats, process: Process) -> Flags:
    """Whether the tool stands too obliquely (N,) on the layer."""
    if process.beam is None:
        return np.zeros(len(axes), bool)
    return np.asarray(np.einsum("ij,ij->i", axes, normals) < np.cos(process.beam.incidence) - STILL)


class _Try(NamedTuple):
    """Tool ``axes`` (N,3) along a pass; the least distance ``gaps`` (N-1,) between each two points, and pose and axis
    (N-1,3) where it is."""

    axes: Floats
    gaps: Floats
    poses: Floats
    turned: Floats


def _measure(points: Floats, axes: Floats, normals: Floats, around: Gauge, process: Process, chosen: Flags) -> _Try:
    """The gaps along a way on the ``chosen`` stretches (N-1,); 0 on others, and where the tool would turn too fast, or
    stand too obliquely on the layer."""
    length = np.linalg.norm(np.diff(points, axis=0), axis=1)
    is_fast = np.linalg.norm(np.diff(axes, axis=0), axis=1) > process.turn_rate * length + STILL
    oblique = _find_oblique(axes, normals, process)
    which = np.flatnonzero(chosen & ~is_fast & ~oblique[1:] & ~oblique[:-1])
    found = _Try(axes, np.zeros(len(length)), points[:-1].copy(), axes[:-1].copy())
    if not len(which):
        return found
    counts = np.maximum(np.ceil((length + around.bound_turns(axes))[which] / process.step - 1e-9).astype(int), 1)
    # the last pose of a stretch is the first of the next, where that is measured too
    many = counts + np.append(np.diff(which) > 1, True)
    starts = np.cumsum(many) - many
    number = np.repeat(np.arange(len(which)), many)
    share = ((np.arange(len(number)) - starts[number]) / counts[number])[:, None]
    here = which[number]
    poses = (1 - share) * points[here] + share * points[here + 1]
    turned = normalise((1 - share) * axes[here] + share * axes[here + 1])
    gaps = around.measure_poses(poses, turned, process.gap)
    # where the next stretch has it, its first pose counts too
    stops = starts + counts
    where = np.array([low + int(np.argmin(gaps[low : high + 1])) for low, high in zip(starts, stops, strict=True)])
    found.gaps[which], found.poses[which], found.turned[which] = gaps[where], poses[where], turned[where]
    return found


def _cut(free: Flags, least: int) -> list[tuple[int, int, int]]:
    """The way, and the first and last stretch (not included), of each run: the longest free one of any way, and so on
    before and after it. ``free``: (ways, stretches)."""
    runs: list[tuple[int, int, int]] = []
    todo = [(0, free.shape[1])]
    while todo:
        low, high = todo.pop()
        spans = [_find_longest(row[low:high]) for row in free]
        number = int(np.argmax([stop - start for start, stop in spans]))
        start, stop = spans[number]
        if stop - start < least:
            continue
        runs.append((number, low + start, low + stop))
        todo += [(low, low + start), (low + stop, high)]
    return sorted(runs, key=lambda run: run[1])


def _find_longest(free: Flags) -> tuple[int, int]:
    runs = find_runs(free)
    if not len(runs):
        return 0, 0
    start, stop = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return int(start), int(stop)


def make_pass(points: Floats, normals: Floats, run: Run, layer: int, process: Process, reach: float) -> Pass:
    """The pass of a run, without the points between which it is straight. ``reach``: the farthest of the nozzle."""
    own = slice(run.start, run.stop)
    line, up = points[own], normals[own]
    scale = [STRAIGHT * process.bead.width, TURN * process.gap / reach, 0.02]
    kept = _thin(np.concatenate([line / scale[0], run.axes / scale[1], up / scale[2]], axis=1), line)
    slack = process.step / 2 + STRAIGHT * process.bead.width + TURN * process.gap
    return Pass(line[kept], run.axes[kept], up[kept], layer, run.gap - slack, run.tightest)


def _thin(values: Floats, line: Floats) -> Ints:
    """The numbers of the points that are kept so that ``values`` (N,K) between them differ by 1 at most from those
    that change evenly along the line (N,3)."""
    far = measure_along(line)

    def measure_off(low: int, high: int) -> Floats:
        share = ((far[low + 1 : high] - far[low]) / max(far[high] - far[low], 1e-300))[:, None]
        return np.asarray(np.abs(values[low + 1 : high] - (1 - share) * values[low] - share * values[high]).max(axis=1))

    return find_corners(len(line), measure_off, 1.0)
