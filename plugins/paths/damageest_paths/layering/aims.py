"""Where in a layer the middles of beads may lie: on the deposit, and in sight of the nozzle."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from damageest_paths.fill.regions import make_region, shift_border
from damageest_paths.process.process import Process

FLUSH = 0.02
"""Share of its radius by which a bead or beam may touch a wall beside it."""
UP, DOWN = (0.0, 0.0, 1.0), (0.0, 0.0, -1.0)
SLICES = 4
"""Heights between bead and tip at which a widening beam is compared with the metal."""


class Aims(NamedTuple):
    """Regions of a plane.

    ``free``: where the middles of beads may lie, None for everywhere; ``reached``: what they then cover at most;
    ``flush``: what those cover that only keep out of the metal of the layer itself; ``drawn``: somewhat less than
    reached, so that a ring half a bead within its border is free.
    """

    free: Any
    reached: Any
    flush: Any
    drawn: Any


def find_sink(height: float, process: Process) -> float:
    """How deep a bead may lie in intact metal, in a layer of a height."""
    return min(process.sink_share * height if process.sink is None else process.sink, (1 - FLUSH) * height)


def measure_margin(standoff: float, process: Process) -> float:
    """How far beside what is wanted of a layer metal counts."""
    return 2 * process.bead.width + (process.beam.measure_radius(standoff) if process.beam else 0.0)


def find_aims(
    metal: Any, beside: Any, wanted: Any, layer: tuple[float, float], standoff: float, process: Process
) -> Aims:
    """The aims of a layer between two heights.

    A bead may lie in metal, a Manifold, by the process's ``sink``. ``beside``: what of it is no higher than the layer.
    Above that the beam along z must not meet any, but where the tool may be tilted: there each pose is looked at.
    ``wanted``: the region round which the metal counts. Without a beam all is free.
    """
    from manifold3d import CrossSection

    beam = process.beam
    if beam is None:
        return Aims(None, wanted, wanted, wanted)
    floor, top = layer
    left, low, right, high = wanted.bounds() if not wanted.is_empty() else (0.0, 0.0, 0.0, 0.0)
    width = process.bead.width
    radius = min(width / 2, beam.radius)
    margin = measure_margin(standoff, process)
    extent = (right - left + 2 * margin, high - low + 2 * margin)
    plane = CrossSection.square(extent).translate((left - margin, low - margin))
    sink = find_sink(top - floor, process)
    free = plane - shift_border(cast_shadow(beside.trim_by_plane(UP, floor + sink), process), (1 - FLUSH) * radius)
    # a ring half a bead within what is drawn lies within the free region, by a little; what it covers is reached
    reach = width / 2 * (1 - FLUSH / 2)
    flush = shift_border(free, reach)
    if process.axes == 5:
        return Aims(free, flush, flush, flush)
    column = metal ^ plane.extrude(standoff).translate((0, 0, top))
    if beam.cone == 0:
        free -= shift_border(_shadow(column, top, top + standoff, process), (1 - FLUSH) * beam.radius)
    else:
        heights = np.linspace(0, standoff, SLICES + 1)
        for bottom, end in zip(heights[:-1].tolist(), heights[1:].tolist(), strict=True):
            wide = (1 - FLUSH) * beam.measure_radius(end)
            free -= shift_border(_shadow(column, top + bottom, top + end, process), wide)
    reached = shift_border(free, reach)
    return Aims(free, reached, flush, reached)


def _shadow(metal: Any, low: float, high: float, process: Process) -> Any:
    """The outline, seen from above, of what lies of the metal between two heights."""
    return cast_shadow(metal.trim_by_plane(UP, low).trim_by_plane(DOWN, -high), process)


def cast_shadow(slab: Any, process: Process) -> Any:
    """The outline of a slab, a Manifold, seen from above."""
    if slab.is_empty():
        return make_region([])
    return make_region(slab.project().to_polygons()).simplify(process.bead.width / 200)
