"""Places the lines of a layer along a floor as passes; where no way to hold the tool serves all over it, each gets a
part of the layer with long passes of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from damageest.artefacts import Floats
from damageest_paths.fill.lines import Line
from damageest_paths.fill.regions import cover, measure_length, resample
from damageest_paths.fill.sharing import Reached, share_region
from damageest_paths.fill.weave import estimate
from damageest_paths.holding.follow import find_free_ways, follow_line, limit_tilt, make_pass
from damageest_paths.holding.sweeps import Sweeps
from damageest_paths.layering.planar import COLLIDES, SHADED
from damageest_paths.process.process import Pass, Process, extend_line
from damageest_paths.sheets.patches import Patch

TORN = 3
"""Passes for each line from which it is looked for a way to share the layer out."""
LOST = 20.0
"""Bead widths of way that a square of the bead's width costs which has no bead because the layer is shared out."""


@dataclass(frozen=True, eq=False)
class Placed:
    """``passes``, their places in the plane ``done`` (K,2), and the pieces of lines (K,2) that are ``dropped``, by
    reason."""

    passes: list[Pass]
    done: list[Floats]
    dropped: dict[str, list[Floats]]

    def is_torn(self, count: int) -> bool:
        """Whether ``count`` lines became far more passes."""
        return len(self.passes) >= max(TORN * count, 1)


@dataclass(frozen=True, eq=False)
class Placing:
    """Where lines are placed: a ``patch`` of a ``layer``, and what is ``around`` it; ``reach``: the farthest of the
    nozzle."""

    patch: Patch
    layer: int
    around: Sequence[Sweeps]
    process: Process
    reach: float

    def place(self, lines: Sequence[Line]) -> Placed:
        """The passes along lines of the plane, without the pieces at which the nozzle is not free."""
        placed = Placed([], [], {COLLIDES: [], SHADED: []})
        for line in lines:
            self._place(line, placed)
        return placed

    def share_out(
        self, placed: Placed, lines: Sequence[Line], region: Any, draw: Callable[[Any], list[Line]]
    ) -> Placed:
        """What has fewer passes than what was placed along ``lines``, for a region of the plane that is shared out
        between ways to hold the tool; or that, where it has not. ``draw``: gives the lines of a part."""
        process = self.process
        if process.axes != 5 or process.is_trial:
            return placed
        reached = []
        for line in lines:
            places, _ = resample(line.points, process.bead.width / 2)
            points, normals, _ = self.patch.tree.find(places)
            reached.append(Reached(places, find_free_ways(points, normals, self.around, process)))
        parts = share_region(region, reached, process.bead)
        if len(parts) < 2:
            return placed
        shared = self.place([line for part in parts for line in draw(part)])
        return min(placed, shared, key=lambda each: self._estimate(each, region))

    def _estimate(self, placed: Placed, region: Any) -> float:
        bead = self.process.bead
        bare = float((region - cover(placed.done, bead.width)).area()) / bead.width**2
        return estimate([Line(points, "row") for points in placed.done], region, bead) + LOST * bare

    def _place(self, line: Line, placed: Placed) -> None:
        process = self.process
        places, _ = resample(extend_line(line.points, *process.extend), process.step)
        points, normals, _ = self.patch.tree.find(places)
        least = min(int(np.ceil(process.shortest / process.step)) + 2, len(points))
        runs = follow_line(points, normals, self.around, process, least)
        runs = [run for run in runs if measure_length(points[run.start : run.stop]) >= process.shortest]
        made = [make_pass(points, normals, run, self.layer, process, self.reach) for run in runs]
        placed.passes.extend(replace(one, kind=line.kind) for one in made)
        placed.done.extend(places[run.start : run.stop] for run in runs)
        stops = [0, *(k for run in runs for k in (run.start, run.stop)), len(places)]
        spans = [(max(a - 1, 0), b + 1) for a, b in zip(stops[::2], stops[1::2], strict=True) if b > a]
        for a, b in spans:
            body = [part.clearance.without_beam() for part in self.around]
            upright = limit_tilt(normals[a:b], process.tilt if process.axes == 5 else 0.0)
            free = all((one.bound(points[a:b], upright, process.gap)[0] >= process.gap).mean() > 0.5 for one in body)
            placed.dropped[SHADED if free else COLLIDES].append(places[a:b])
