"""Chooses the tool axes of passes so that the nozzle touches nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest.geometry.vectors import normalise
from damageest_paths.clearance.bridging import LONGER, PLACES, list_bridges
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.clearance.pose_table import PoseTable
from damageest_paths.clearance.turning import BLOCKED, Course, cost_poses, plan_course

RING, AROUND = np.radians(20.0), 8
"""Difference of tilt between the rings of axes that are tried, and their number round the build direction."""
ROOM = 1.5
"""Multiple of the distance needed that counts as room to spare."""
BEST = 3
"""Axes that are tried all along a pass before it is let turn."""
EASED = (0.25, 0.5, 0.75)
"""Shares of a tilt that are tried in turn, whether they do too."""
ROUNDS = 2
"""How often the turning axes of a pass are chosen, without the poses that turned out not to be free."""


@dataclass(frozen=True)
class Limits:
    """``needed``: distance that the nozzle has to keep. ``step``: how far any of its points moves between two poses
    that are measured. ``rate``: largest turn of the axis per length along a pass, in radians. ``least``: points of a
    piece of a pass. ``eases``: whether axes are tilted by no more than it takes."""

    needed: float
    step: float
    rate: float
    least: int
    eases: bool = False


class Piece(NamedTuple):
    """Points ``start`` to ``stop`` (not included) of a pass with ``axes`` (K,3), and the least distances (K,) that were
    measured there and on the way to the next."""

    start: int
    stop: int
    axes: Floats
    gaps: Floats


class _Found(NamedTuple):
    """A course, the distances (N,) at its points, and those (N-1,) between each and the next."""

    course: Course
    gaps: Floats
    between: Floats


def list_axes(tilt: float, ring: float = RING, around: int = AROUND) -> Floats:
    """Axes (M,3) in local coordinates: the build direction z, then rings round it up to a ``tilt`` in radians."""
    rings = np.linspace(0, tilt, 1 + int(np.ceil(tilt / ring - 1e-9)))[1:] if tilt > 0 else np.empty(0)
    angle = 2 * np.pi * np.arange(around) / around
    found = [np.array([[0.0, 0.0, 1.0]])]
    for each in rings:
        sides = np.sin(each) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        found.append(np.column_stack([sides, np.full(around, np.cos(each))]))
    return np.concatenate(found)


def choose_axes(
    lines: Sequence[Floats], axes: Floats, first: int, clearance: Clearance, limits: Limits
) -> list[list[Piece]]:
    """For each pass of a layer its pieces, with axes at which the nozzle keeps its distance.

    Args:
        lines: points (N,3) of each pass, not farther from each other than the step.
        axes: (M,3) to choose from, from the least tilted to the most.
        first: number of the axis that is taken where it is free all along, as that of the layer before.

    Returns:
        The pieces in the order of the points. Points in none of them cannot be reached. A pass is one piece with one
        axis where there is one that is free all along: ``first`` where it is for all passes, else one that is for as
        many as possible. Else the axis turns along the pass; it is cut where no turn is free.
    """
    found = _measure([_keep(line, axes[first]) for line in lines], lines, clearance, limits)
    if len(axes) > 1 and not all(_is_free(one, limits) for one in found):
        table = PoseTable(lines, axes, clearance, limits.needed, ROOM * limits.needed)
        going = _share_axes(found, lines, table, first, clearance, limits)
        _let_turn(found, going, lines, table, clearance, limits)
        if limits.eases:
            _bridge(found, lines, clearance, limits)
            _ease(found, lines, clearance, limits)
    return [_cut(one, limits) for one in found]


def _keep(line: Floats, axis: Floats) -> Course:
    return Course(np.tile(axis, (len(line), 1)), np.ones(max(len(line) - 1, 0), bool))


def _is_free(one: _Found, limits: Limits) -> bool:
    is_free = one.gaps.min() >= limits.needed and one.between.min(initial=np.inf) >= limits.needed
    return bool(is_free and one.course.joined.all())


def _share_axes(
    found: list[_Found], lines: Sequence[Floats], table: PoseTable, first: int, clearance: Clearance, limits: Limits
) -> list[int]:
    """Replaces what was found for passes that one axis serves all along; gives the numbers of the others.

    Few axes serve all: between two of them the tool may have to leave a tight place and come back. Each is the one that
    serves the most of the passes that are left (Chvatal 1979), with room to spare if possible, near to ``first``.
    """
    axes, room = table.axes, table.find_room()
    free, roomy = room >= table.needed, room >= table.room
    free[:, first] = [_is_free(one, limits) for one in found]
    turn = np.arccos(np.clip(axes @ axes[first], -1, 1))
    tries = np.full(len(lines), BEST)
    left = np.ones(len(lines), bool)
    while (free[left].any(axis=1) & (tries[left] > 0)).any():
        own = free & (left & (tries > 0))[:, None]
        number = int(np.lexsort([np.arange(len(axes)), turn, -(own * 1 + (own & roomy)).sum(axis=0)])[0])
        tried = np.flatnonzero(own[:, number]).tolist()
        courses = [_keep(lines[k], axes[number]) for k in tried]
        for k, one in zip(tried, _measure(courses, [lines[k] for k in tried], clearance, limits), strict=True):
            if _is_free(one, limits):
                found[k], left[k] = one, False
            elif not _is_free(found[k], limits):
                found[k] = one
        free[tried, number] = False
        tries[tried] -= 1
    return list(map(int, np.flatnonzero(left)))


def _let_turn(
    found: list[_Found],
    going: list[int],
    lines: Sequence[Floats],
    table: PoseTable,
    clearance: Clearance,
    limits: Limits,
) -> None:
    """Replaces what was found for passes by courses whose axis turns."""
    if not going:
        return
    axes, cost = table.axes, {}
    for k, (low, high) in zip(going, table.bound(going), strict=True):
        cost[k] = _fill_in(cost_poses(low, high, axes, table.needed, table.room), len(lines[k]))
    for _ in range(ROUNDS):
        courses = [plan_course(lines[k], axes, cost[k], limits.rate) for k in going]
        for k, one in zip(going, _measure(courses, [lines[k] for k in going], clearance, limits), strict=True):
            found[k] = one
            nearest = np.argmax(one.course.axes @ axes.T, axis=1)
            wrong = np.flatnonzero((one.gaps < limits.needed) & (cost[k][np.arange(len(nearest)), nearest] < BLOCKED))
            cost[k][wrong, nearest[wrong]] = BLOCKED
            if not len(wrong):
                going = [other for other in going if other != k]
        if not going:
            break


def _bridge(found: list[_Found], lines: Sequence[Floats], clearance: Clearance, limits: Limits) -> None:
    """Replaces what was found for passes with breaks: the tool turns over them where that is free."""
    for shape in product(LONGER, PLACES):
        bridges = [
            bridge
            for k, (one, line) in enumerate(zip(found, lines, strict=True))
            if not _is_free(one, limits)
            for bridge in list_bridges(k, line, one.course.axes, _goes_on(one, limits), limits.rate, shape)
        ]
        if not bridges:
            continue
        courses = [Course(each.axes, np.ones(len(each.axes) - 1, bool)) for each in bridges]
        spans = [lines[each.number][each.start : each.stop] for each in bridges]
        for each, tried in zip(bridges, _measure(courses, spans, clearance, limits), strict=True):
            if _is_free(tried, limits):
                course, gaps, between = found[each.number]
                course.axes[each.start : each.stop] = tried.course.axes
                course.joined[each.start : each.stop - 1] = True
                gaps[each.start : each.stop] = tried.gaps
                between[each.start : each.stop - 1] = tried.between


def _goes_on(one: _Found, limits: Limits) -> Flags:
    """Whether (N-1,) a pass goes on from each point to the next."""
    free = one.gaps >= limits.needed
    return np.asarray(free[:-1] & free[1:] & one.course.joined & (one.between >= limits.needed))


def _ease(found: list[_Found], lines: Sequence[Floats], clearance: Clearance, limits: Limits) -> None:
    """Replaces what was found for passes along which the tool is tilted by the least share of that at which they are
    free."""
    left = [k for k, one in enumerate(found) if _is_free(one, limits) and one.course.axes[:, 2].min() < 1 - 1e-9]
    for share in EASED:
        if not left:
            break
        courses = [Course(turn_upright(found[k].course.axes, share), found[k].course.joined) for k in left]
        tried = _measure(courses, [lines[k] for k in left], clearance, limits)
        eased = {k: one for k, one in zip(left, tried, strict=True) if _is_free(one, limits)}
        for k, one in eased.items():
            found[k] = one
        left = [k for k in left if k not in eased]


def turn_upright(axes: Floats, share: float) -> Floats:
    """Axes (N,3) with a share of their angle with z."""
    flat = np.linalg.norm(axes[:, :2], axis=1)
    angle = share * np.arctan2(flat, axes[:, 2])
    side = axes[:, :2] / np.maximum(flat, 1e-300)[:, None]
    return np.column_stack([np.sin(angle)[:, None] * side, np.cos(angle)])


def _fill_in(costs: Floats, count: int) -> Floats:
    """Costs (N,M) for all of ``count`` points from those of each second and the last: the larger one of both sides."""
    before, after = np.arange(count) // 2, (np.arange(count) + 1) // 2
    after[-1] = before[-1] = len(costs) - 1
    return np.maximum(costs[before], costs[after])


def _measure(courses: Sequence[Course], lines: Sequence[Floats], clearance: Clearance, limits: Limits) -> list[_Found]:
    """What the nozzle keeps along each course; where the axis turns, at as many poses between as it takes."""
    points, axes, joined = (
        np.concatenate(lines),
        np.concatenate([course.axes for course in courses]),
        np.concatenate([np.append(course.joined, False) for course in courses]),
    )
    moves = clearance.bound_moves(points, axes)
    turning = joined[:-1] & (np.abs(np.diff(axes, axis=0)).max(axis=1, initial=0.0) > 1e-9)
    counts = np.append(np.where(turning, np.ceil(moves / limits.step - 1e-9), 1).astype(int), 1)
    place = np.repeat(np.arange(len(points)), counts)
    share = np.concatenate([np.arange(count) / count for count in counts])[:, None]
    following = np.minimum(place + 1, len(points) - 1)
    dense = points[place] + share * (points[following] - points[place])
    turned = axes[place] + share * (axes[following] - axes[place])
    turned = normalise(turned)
    gaps = clearance.measure_poses(dense, turned, limits.needed)
    starts = np.cumsum(counts) - counts
    least = np.minimum.reduceat(gaps, starts)
    ends = np.cumsum([len(line) for line in lines])[:-1]
    return [
        _Found(course, at, between[:-1])
        for course, at, between in zip(courses, np.split(gaps[starts], ends), np.split(least, ends), strict=True)
    ]


def _cut(one: _Found, limits: Limits) -> list[Piece]:
    """The pieces of a pass that are free, without those that are too short."""
    free = one.gaps >= limits.needed
    goes_on = _goes_on(one, limits)
    least = np.minimum(one.gaps, np.append(one.between, np.inf))
    pieces = []
    for start, stop in _list_runs(free, goes_on):
        if stop - start >= min(limits.least, len(free)):
            gaps = np.append(least[start : stop - 1], one.gaps[stop - 1])
            pieces.append(Piece(start, stop, one.course.axes[start:stop], gaps))
    return pieces


def _list_runs(free: Flags, goes_on: Flags) -> list[tuple[int, int]]:
    """Start and stop of each run of free points that goes on from each to the next."""
    starts = np.flatnonzero(free & ~np.concatenate([[False], goes_on]))
    stops = np.flatnonzero(free & ~np.concatenate([goes_on, [False]])) + 1
    return list(zip(starts.tolist(), stops.tolist(), strict=True))
