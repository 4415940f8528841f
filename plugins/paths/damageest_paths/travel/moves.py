"""Puts passes in a sequence, with the moves between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats, Ints
from damageest.geometry.vectors import normalise
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.process.process import Pass
from damageest_paths.travel.exits import Exit, Travel, find_exit, leave, lift_to_sphere, list_exits
from damageest_paths.travel.network import Network, Way, measure_blocked_way, measure_way
from damageest_paths.travel.shortcuts import cut_corners

LIFTS = (1, 2, 4, 8)
"""Multiples of the hop that are tried."""
RADII = (0.25, 0.35, 0.5, 0.6, 0.7, 0.85, 1.0)
"""Shares of the safe distance at which the tool goes round the part."""
SHORT = 4.0
"""Lengths of the hop by which a lifted way may be longer than the straight one before others are looked for."""
SAME = 1e-6
"""Difference of two unit axes up to which they are the same."""
FLAT = 0.01
"""Share of the gap up to which two heights are the same."""


class Moves(NamedTuple):
    """Points (N,3), tool axes (N,3), normals (N,3), speed (N,), whether the move that ends there deposits (N,), layer
    (N,), pass (N,) and part (N,). ``gap``: least distance of the nozzle during travel; ``blocked``: travels for which
    no clear way was found. ``kinds``: of the passes, in their order; ``free_ends`` (K,): whether the tool can leave to
    the safe distance straight along its axis from the end of each; None where the axis is the same everywhere."""

    points: Floats
    axes: Floats
    normals: Floats
    feed: Floats
    on: Flags
    layer: Ints
    number: Ints
    part: Ints
    gap: float
    blocked: int
    kinds: tuple[str, ...]
    free_ends: Flags | None


def join_passes(groups: Sequence[Sequence[Pass]], clearance: Clearance, travel: Travel) -> Moves:
    """One sequence of moves through passes in the part's frame.

    ``groups``: the passes of each part of the deposit. ``clearance``: to what is there; the layers, numbered from 1
    over all groups, have that rank. Between two passes the tool stays down where the straight way is clear, else it is
    lifted by the hop, or by as much more as a clear way needs, up to the safe distance. It comes and leaves along its
    axis; where that is not clear, along that of another pass, or from above that pass. On the way to a pass the layers
    before it stand, and its own layer unless the pass is the first of it.
    """
    rows: list[tuple[Floats, Floats, Floats, float, bool, int, int, int]] = []
    gap, number, blocked = np.inf, 0, 0
    before: Pass | None = None
    old, ranks, exits = 0, rank_layers(groups), list_exits(groups)
    free_ends: list[bool] | None = [] if _is_turning(groups) else None
    network = Network(groups, travel.hop, travel.gap, clearance.reach)
    for part, passes in enumerate(groups, 1):
        for one in passes:
            rank = ranks[part - 1, one.layer]
            number += 1
            standing = clearance.after(rank if rank == old else rank - 1)
            way, way_axes, found = _find_way(before, one, exits, network, standing, travel)
            old = rank
            if found < travel.gap / 2:
                blocked += 1
                found = _measure_blocked(before, way, way_axes, one, standing, travel)
            gap = min(gap, found)
            for point, axis in zip(way, way_axes, strict=True):
                rows.append((point, axis, one.normals[0], travel.fast, False, one.layer + 1, number, part))
            first = (one.points[0], one.axes[0], one.normals[0], travel.fast, False, one.layer + 1, number, part)
            rows.append(first)
            for k in range(1, len(one.points)):
                values = (one.points[k], one.axes[k], one.normals[k], travel.feed, True)
                rows.append((*values, one.layer + 1, number, part))
            if free_ends is not None:
                free_ends.append(_is_end_free(one, clearance.after(rank), travel))
            before = one
    if before is not None:
        standing = clearance.after(len(ranks))
        way, way_axes, found = leave(before.points[-1], before.axes[-1], exits, network, standing, travel)
        if found < travel.gap / 2:
            blocked += 1
            found = _measure_blocked(before, way, way_axes, None, standing, travel)
        gap = min(gap, found)
        for point, axis in zip(way, way_axes, strict=True):
            rows.append((point, axis, before.normals[-1], travel.fast, False, rows[-1][5], number, rows[-1][7]))
    kinds = tuple(one.kind for passes in groups for one in passes)
    columns: list[Any] = list(zip(*rows, strict=True)) or [()] * 8
    points, axes, normals = (np.array(column, float).reshape(-1, 3) for column in columns[:3])
    layer, numbers, parts = (np.array(column, np.int64) for column in columns[5:])
    feed, on = np.array(columns[3], float), np.array(columns[4], bool)
    return Moves(
        points, axes, normals, feed, on, layer, numbers, parts, max(gap, 0.0), blocked, kinds,
        None if free_ends is None else np.array(free_ends, bool),
    )  # fmt: skip


def _measure_blocked(
    before: Pass | None, way: Floats, axes: Floats, after: Pass | None, clearance: Clearance, travel: Travel
) -> float:
    """The least distance on a ``way`` (K,3) with tool ``axes`` (K,3) from the end of a pass to the start of another."""
    poses = [(way, axes)]
    if before is not None:
        poses.insert(0, (before.points[-1:], before.axes[-1:]))
    if after is not None:
        poses.append((after.points[:1], after.axes[:1]))
    points, turned = (np.concatenate(each) for each in zip(*poses, strict=True))
    return measure_blocked_way(points, turned, clearance, travel.gap)


def _is_turning(groups: Sequence[Sequence[Pass]]) -> bool:
    """Whether the tool axis is not the same everywhere."""
    axes = np.concatenate([np.empty((0, 3)), *(one.axes for passes in groups for one in passes)])
    return bool((np.abs(axes - axes[:1]) > SAME).any())


def _is_end_free(one: Pass, clearance: Clearance, travel: Travel) -> bool:
    """Whether the tool can leave the end of a pass straight along its axis to the safe distance."""
    point, axis = one.points[-1], one.axes[-1]
    out = np.array([point, lift_to_sphere(point, axis, travel, travel.safe)])
    return measure_way(out, np.array([axis, axis]), clearance, travel.gap) >= travel.gap / 2


def find_corners(points: Floats) -> Floats:
    """The corners (K,3) of the convex hull of ``points`` (N,3); all points where they have none, as on a plane."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except QhullError:
        return points


def rank_layers(groups: Sequence[Sequence[Pass]]) -> dict[tuple[int, int], int]:
    """The number, from 1, of each layer that has passes, by the number of its group and its own in the group."""
    layers = dict.fromkeys((number, one.layer) for number, passes in enumerate(groups) for one in passes)
    return {each: rank for rank, each in enumerate(layers, 1)}


def _find_way(
    before: Pass | None, one: Pass, exits: Sequence[Exit], network: Network, clearance: Clearance, travel: Travel
) -> Way:
    """Points (K,3) and axes (K,3) from the end of a pass to above the start of the next, and the least distance."""
    stop, axis = one.points[0], one.axes[0]
    if before is None:
        points, axes, gap = leave(stop, axis, exits, network, clearance, travel)
        return Way(points[::-1], axes[::-1], gap)
    start, old = before.points[-1], before.axes[-1]
    if np.linalg.norm(stop - start) < 1e-9 and np.allclose(axis, old):
        return Way(np.empty((0, 3)), np.empty((0, 3)), np.inf)
    lifted = _lift_over(start, old, one, clearance, travel)
    if lifted is not None and _measure_length(start, lifted, stop) <= np.linalg.norm(stop - start) + SHORT * travel.hop:
        return lifted
    found = network.find_way((start, old), (stop, axis), clearance)
    ways = [each for each in (lifted, found) if each is not None]
    ways = ways or [_go_round(start, old, one, exits, clearance, travel)]
    way = min(ways, key=lambda each: _measure_length(start, each, stop))
    if way.gap < travel.gap / 2:
        return way
    whole = Way(np.vstack([start, way.points, stop]), np.vstack([old, way.axes, axis]), way.gap)
    short = cut_corners(whole, clearance, travel.gap)
    return Way(short.points[1:-1], short.axes[1:-1], short.gap)


def _lift_over(start: Floats, old: Floats, one: Pass, clearance: Clearance, travel: Travel) -> Way | None:
    """As `_find_way` from a place (3,) with an axis (3,): straight, lifted as little as is clear; None where nothing
    is."""
    stop, axis = one.points[0], one.axes[0]
    rise = float((stop - start) @ one.normals[0])
    for factor in [0, *LIFTS] if travel.stays else LIFTS:
        lift = factor * travel.hop
        if np.linalg.norm(stop - travel.centre) + lift > travel.safe:
            break
        # both ends at the height of the higher one
        way = np.array([start + (max(rise, 0.0) + lift) * old, stop + (max(-rise, 0.0) + lift) * axis])
        kept = np.array([factor > 0 or rise > travel.gap * FLAT, factor > 0 or -rise > travel.gap * FLAT])
        axes = np.array([old, axis])
        points = np.concatenate([start[None], way[kept], stop[None]])
        gap = measure_way(points, np.concatenate([old[None], axes[kept], axis[None]]), clearance, travel.gap)
        if gap >= travel.gap / 2:
            return Way(way[kept], axes[kept], gap)
    return None


def _measure_length(start: Floats, way: Way, stop: Floats) -> float:
    """The length of a way from one place (3,) to another."""
    return float(np.linalg.norm(np.diff(np.vstack([start, way.points, stop]), axis=0), axis=1).sum())


def _go_round(
    start: Floats, old: Floats, one: Pass, exits: Sequence[Exit], clearance: Clearance, travel: Travel
) -> Way:
    """As `_find_way` from a place (3,) with an axis (3,), over the part or round it: the nearest way that is clear."""
    stop, axis = one.points[0], one.axes[0]
    best = Way(np.empty((0, 3)), np.empty((0, 3)), -np.inf)
    far = max(float(np.linalg.norm(point - travel.centre)) for point in (start, stop))
    radii = [share * travel.safe for share in RADII if share == 1 or share * travel.safe > far + 2 * travel.hop]
    for radius in [0.0, *radii] if np.abs(axis - old).max() < SAME else radii:
        out, out_axes, first = find_exit(start, old, exits, clearance, travel, radius)
        back, back_axes, last = find_exit(stop, axis, exits, clearance, travel, radius)
        ends, turned = np.array([out[-1], back[-1]]), np.array([out_axes[-1], back_axes[-1]])
        if not radius and np.abs(turned[0] - turned[1]).max() > SAME:
            continue
        way, axes = _round_the_sphere(ends, turned, travel) if radius else (ends, turned)
        gap = min(first, last, measure_way(way, axes, clearance, travel.gap))
        if gap > best[2]:
            points = np.concatenate([out[:-1], way, back[-2::-1]])
            best = Way(points, np.concatenate([out_axes[:-1], axes, back_axes[-2::-1]]), gap)
        if gap >= travel.gap / 2:
            break
    return best


def _round_the_sphere(way: Floats, axes: Floats, travel: Travel) -> tuple[Floats, Floats]:
    """The way between two points at the safe distance, along the sphere, with the axis turning evenly."""
    first, last = way - travel.centre
    far = max(float(np.linalg.norm(first)), float(np.linalg.norm(last)))
    angle = float(np.arccos(np.clip(first @ last / (np.linalg.norm(first) * np.linalg.norm(last)), -1, 1)))
    turn = float(np.arccos(np.clip(axes[0] @ axes[1], -1, 1)))
    count = int(np.ceil(max(angle, turn) / np.radians(10.0)))
    if count < 2:
        return way, axes
    share = np.linspace(0, 1, count + 1)[:, None]
    inner = (1 - share) * first + share * last
    inner *= far / np.maximum(np.linalg.norm(inner, axis=1), 1e-9 * far)[:, None]
    inner[0], inner[-1] = first, last
    turned = (1 - share) * axes[0] + share * axes[1]
    turned = normalise(turned, 1e-9)
    return travel.centre + inner, turned
