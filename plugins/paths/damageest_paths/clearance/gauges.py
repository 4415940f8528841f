"""What measures the nozzle's distances along a path."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from damageest.artefacts import Floats


class Gauge(Protocol):
    """Distances along a path, as those of `Clearance`."""

    def measure_poses(self, points: Floats, axes: Floats, needed: float) -> Floats: ...

    def bound_turns(self, axes: Floats) -> Floats: ...


class LeastGauge:
    """The least of the distances that several gauges of one nozzle measure."""

    def __init__(self, parts: Sequence[Gauge]) -> None:
        self.parts = parts

    def measure_poses(self, points: Floats, axes: Floats, needed: float) -> Floats:
        """As `Clearance.measure_poses`."""
        found = self.parts[0].measure_poses(points, axes, needed)
        for part in self.parts[1:]:
            open_ = np.flatnonzero(found >= needed)
            if len(open_):
                found[open_] = np.minimum(found[open_], part.measure_poses(points[open_], axes[open_], needed))
        return np.asarray(found)

    def bound_turns(self, axes: Floats) -> Floats:
        """As `Clearance.bound_turns`."""
        return self.parts[0].bound_turns(axes)
