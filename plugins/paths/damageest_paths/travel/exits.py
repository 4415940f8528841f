"""Ways of the tool from a pass to where it is clear of everything, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from damageest.artefacts import Floats
from damageest.geometry.transforms import turn_to_axis
from damageest.geometry.vectors import measure_to_sphere
from damageest_paths.clearance.clearance import Clearance
from damageest_paths.process.process import Pass
from damageest_paths.travel.network import Network, measure_way

MOST_EXITS = 12
"""Passes whose axes, and places, are tried where the tool cannot leave along its own axis, as in a bore."""
SIDES = 24
"""Directions at a right angle to the tool axis in which the tool may leave."""
RISES = (1.0, 4.0)
"""Hops by which it is lifted before that."""
SHORTER = 0.7
"""Share of the way along the axis that such a way is long at most."""


@dataclass(frozen=True)
class Travel:
    """``hop``: how far the tool is lifted along its axis between passes; ``stays``: whether it is not where the way is
    free without. ``safe``: a distance from ``centre`` (3,) at which the nozzle is clear of everything. ``corners``
    (N,3): of the hull of everything, and ``above``: how far beyond it along the tool axis the nozzle is clear, measured
    to the point that it works on; ``beside``: how far from it all of the nozzle is clear sideways, None where the tool
    is not to leave that way. ``gap``: distance to keep. ``feed``, ``fast``: speeds of deposition and of travel, in
    lengths a minute."""

    hop: float
    safe: float
    centre: Floats
    gap: float
    feed: float
    fast: float
    corners: Floats
    above: float
    stays: bool = True
    beside: float | None = None


class Exit(NamedTuple):
    """A ``place`` (3,) from which the tool may be clear when it leaves along an ``axis`` (3,)."""

    place: Floats
    axis: Floats


def _lift(point: Floats, axis: Floats, travel: Travel) -> Floats:
    """The point (3,) straight up the axis from which on all the nozzle is above everything, or at the safe distance."""
    top = float((travel.corners @ axis).max()) + travel.above
    sphere = float(lift_to_sphere(point, axis, travel, travel.safe) @ axis)
    return np.asarray(point + max(min(top, sphere) - float(point @ axis), travel.hop) * axis)


def lift_to_sphere(point: Floats, axis: Floats, travel: Travel, radius: float) -> Floats:
    """The point (3,) at a distance from the centre, straight up the axis."""
    far = float(measure_to_sphere(point[None], axis[None], travel.centre, radius)[0])
    return np.asarray(point + max(far, travel.hop) * axis)


def list_exits(groups: Sequence[Sequence[Pass]]) -> list[Exit]:
    """The tool axes of the passes, each once, in their order, with the start of the first pass that has it."""
    found: dict[tuple[float, ...], Exit] = {}
    for passes in groups:
        for one in passes:
            key = tuple(np.round(one.axes[0], 6).tolist())
            found.setdefault(key, Exit(one.points[0], one.axes[0]))
    return list(found.values())[:MOST_EXITS]


def _list_ways_out(
    point: Floats, axis: Floats, exits: Sequence[Exit], travel: Travel, lift: Callable[[Floats, Floats], Floats]
) -> Iterator[tuple[Floats, Floats]]:
    """Ways from a place (3,) to where ``lift`` takes it: points (K,3) and axes (K,3). Straight up the tool's ``axis``
    (3,); after a hop along that of an exit; from above the exit."""
    yield lift(point, axis)[None], axis[None]
    turned = [(point, gate.axis) for gate in exits if not np.allclose(gate.axis, axis)]
    for place, along in [*turned, *exits]:
        way = [point + travel.hop * axis, place + travel.hop * along, lift(place, along)]
        yield np.array(way), np.array([axis, along, along])


def find_exit(
    point: Floats, axis: Floats, exits: Sequence[Exit], clearance: Clearance, travel: Travel, radius: float = 0.0
) -> tuple[Floats, Floats, float]:
    """Points (K,3) and axes (K,3) from a place (3,) on a pass to where the nozzle is above everything, or at a distance
    ``radius`` from the centre, and the least distance: the first way that is clear, else the clearest."""

    def lift(place: Floats, along: Floats) -> Floats:
        return lift_to_sphere(place, along, travel, radius) if radius else _lift(place, along, travel)

    best = np.empty((0, 3)), np.empty((0, 3)), -np.inf
    for way, axes in _list_ways_out(point, axis, exits, travel, lift):
        points, turned = np.concatenate([point[None], way]), np.concatenate([axis[None], axes])
        gap = measure_way(points, turned, clearance, travel.gap)
        if gap > best[2]:
            best = way, axes, gap
        if gap >= travel.gap / 2:
            break
    return best


def leave(
    point: Floats, axis: Floats, exits: Sequence[Exit], network: Network, clearance: Clearance, travel: Travel
) -> tuple[Floats, Floats, float]:
    """As `find_exit`, to above everything; where that is shorter, sideways to beside everything; where no such way is
    clear, over poses from which one is."""
    aside = _leave_sideways(point, axis, clearance, travel)
    if aside is not None:
        return aside
    way, axes, gap = find_exit(point, axis, exits, clearance, travel)
    if gap >= travel.gap / 2:
        return way, axes, gap
    for found in network.find_exits((point, axis), clearance):
        place, along = found.points[-1], found.axes[-1]
        out = _lift(place, along, travel)
        last = measure_way(np.array([place, out]), np.array([along, along]), clearance, travel.gap)
        if last >= travel.gap / 2:
            return np.vstack([found.points, out]), np.vstack([found.axes, along]), min(last, found.gap)
    return way, axes, gap


def _leave_sideways(
    point: Floats, axis: Floats, clearance: Clearance, travel: Travel
) -> tuple[Floats, Floats, float] | None:
    """As `leave`: lifted a little, then at a right angle to the axis, until a plane across that direction parts all of
    the nozzle from everything. So nothing is met either where the tool goes on along its axis. The shortest clear way;
    None where none is, or the one along the axis is hardly longer."""
    if travel.beside is None:
        return None
    turn = turn_to_axis(axis)
    angle = np.arange(SIDES) * 2 * np.pi / SIDES
    sides = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)]) @ turn.T
    nozzle = point + clearance.standoff * axis + clearance.nozzle.mesh.vertices @ turn.T
    far = (travel.corners @ sides.T).max(axis=0) + travel.beside - (nozzle @ sides.T).min(axis=0)
    most = SHORTER * float(np.linalg.norm(_lift(point, axis, travel) - point))
    tried = sorted((rise * travel.hop + max(far[k], 0.0), rise, k) for rise in RISES for k in range(SIDES))
    for length, rise, k in tried:
        if length > most:
            break
        lifted = point + rise * travel.hop * axis
        way, axes = np.array([lifted, lifted + max(far[k], 0.0) * sides[k]]), np.tile(axis, (3, 1))
        gap = measure_way(np.vstack([point, way]), axes, clearance, travel.gap)
        if gap >= travel.gap / 2:
            return way, axes[1:], gap
    return None
