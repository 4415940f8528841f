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
        return np.asarray(np.min([part.measure_poses(points, axes, needed) for part in self.parts], axis=0))

    def bound_turns(self, axes: Floats) -> Floats:
        """As `Clearance.bound_turns`."""
        return self.parts[0].bound_turns(axes)
