"""Bridges the breaks of passes: where the tool would leave one axis for another, it is turned over a longer way."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Flags, Floats
from damageest_paths.clearance.turning import turn_evenly
from damageest_paths.fill.regions import find_runs
from damageest_paths.process.process import measure_along

FARTHEST = np.radians(80.0)
"""Angle between the axes before and after a break up to which the tool may turn from one to the other."""
LONGER, PLACES = (1.0, 2.0, 3.0), (0.5, 0.1, 0.9)
"""How many times as long as it takes the tool turns, and the shares of that which may lie before the break."""


class Bridge(NamedTuple):
    """Turned ``axes`` (K,3) for the points ``start`` to ``stop`` (not included) of a pass, by its ``number``."""

    number: int
    start: int
    stop: int
    axes: Floats


def list_bridges(
    number: int, points: Floats, axes: Floats, goes_on: Flags, rate: float, shape: tuple[float, float]
) -> list[Bridge]:
    """The bridges over the breaks of a pass with ``points`` and ``axes`` (N,3) that may be tried.

    No two of them overlap, and none reaches over a second break. Whether the tool is free there is not looked at.

    Args:
        number: of the pass.
        goes_on: whether the pass goes on from each point to the next (N-1,).
        rate: largest turn of the axis per length, in radians.
        shape: one of `LONGER` and one of `PLACES`.
    """
    along = measure_along(points)
    edges = find_runs(~goes_on)
    # each break with the end of the one before, and the start of the next
    spans = [(0, 0), *map(tuple, edges.tolist()), (len(points) - 1, len(points) - 1)]
    found: list[Bridge] = []
    for (_, low), (first, last), (high, _) in zip(spans, spans[1:], spans[2:], strict=False):
        if first == 0 or last == len(points) - 1:
            continue
        angle = _measure_angle(axes[first], axes[last])
        length = shape[0] * angle / max(rate, 1e-300)
        start = int(np.searchsorted(along, along[first] - shape[1] * length + 1e-12, side="right")) - 1
        stop = int(np.searchsorted(along, along[last] + (1 - shape[1]) * length - 1e-12))
        low = max(low, found[-1].stop - 1) if found else low
        if not 1e-9 < angle <= FARTHEST or start < low or stop > high:
            continue
        way = along[start : stop + 1] - along[start]
        if _measure_angle(axes[start], axes[stop]) <= rate * way[-1] + 1e-9:
            found.append(Bridge(number, start, stop + 1, turn_evenly(axes[start], axes[stop], way / way[-1])))
    return found


def _measure_angle(one: Floats, other: Floats) -> float:
    return float(np.arccos(np.clip(one @ other, -1, 1)))
