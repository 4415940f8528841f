"""The cost of a run: peak memory of each stage, and the processor time that it is compared with."""

from __future__ import annotations

import importlib
import time

import numpy as np

from damageest import hookimpl
from damageest.artefacts import Floats, Mesh
from damageest_evaluate.memory import PeakMemory

HEAVY = (
    "igl",
    "manifold3d",
    "pyvista",
    "scipy.fft",
    "scipy.ndimage",
    "scipy.sparse.csgraph",
    "scipy.spatial",
    "scipy.spatial.transform",
    "scipy.special",
    "scipy.stats",
    "trimesh",
)
"""The large modules that a run imports."""
MOST_POINTS = 1_000_000
"""For scans with more points, the pass of libigl is measured on every n-th point and scaled up."""


class Meter:
    """Observes the stages of a run and takes their peaks from ``memory``."""

    def __init__(self, memory: PeakMemory) -> None:
        self.memory = memory
        self.stage_megabytes: dict[str, float] = {}
        self._largest = 0.0

    def measure_megabytes(self) -> float:
        """The peak of the process since ``memory`` was started."""
        self._largest = max(self._largest, self.memory.take_peak())
        return self._largest

    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        """Takes the peak before the stage, so that the next peak is the stage's own."""
        self.measure_megabytes()

    @hookimpl
    def damageest_after_stage(self, stage: str) -> None:
        peak = self.memory.take_peak()
        self._largest = max(self._largest, peak)
        self.stage_megabytes[stage] = max(self.stage_megabytes.get(stage, 0.0), round(peak))


def measure_start_seconds() -> float:
    """Processor seconds from the start of this process until the modules that a run needs are imported."""
    for name in HEAVY:
        importlib.import_module(name)
    return time.process_time()


def measure_libigl_seconds(points: Floats, part: Mesh) -> float:
    """Processor seconds of libigl's exact signed distance from points (N,3), in order of place, to the part.

    Every method that compares a scan with a CAD model point by point needs this pass. The cost of a run divided by the
    cost of this pass can be compared between machines.
    """
    from damageest.geometry.distance import run_libigl_pass
    from damageest.geometry.voxels import order_by_place

    subset = points[:: -(-len(points) // MOST_POINTS)]
    origin = part.bounds.mean(0)
    places, mesh = (
        np.ascontiguousarray(subset[order_by_place(subset)] - origin),
        Mesh(part.vertices - origin, part.faces),
    )
    start = time.process_time()
    run_libigl_pass(places, mesh)
    return (time.process_time() - start) * len(points) / len(subset)
