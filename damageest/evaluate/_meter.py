"""What a run costs: seconds, processor seconds and peak memory of each stage, and a yardstick to divide them by."""

from __future__ import annotations

import contextlib
import importlib
import resource
import time
from pathlib import Path

import numpy as np

from damageest.artefacts import Floats, Mesh
from damageest.registry.hookspecs import hookimpl

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
"""What a run imports sooner or later."""
YARDSTICK = 1_000_000
"""Points above which the pass of libigl is measured on a part of them."""


class Meter:
    """Observes a run. ``megabytes`` is the process's peak; of each stage, the peak while it ran."""

    def __init__(self) -> None:
        self.stage_megabytes: dict[str, float] = {}
        self._earlier = 0.0

    @property
    def megabytes(self) -> float:
        return max(self._earlier, _peak())

    @hookimpl
    def damageest_before_stage(self, stage: str) -> None:
        """Starts the peak anew, where the system can."""
        self._earlier = self.megabytes
        with contextlib.suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5")

    @hookimpl
    def damageest_after_stage(self, stage: str) -> None:
        self.stage_megabytes[stage] = max(self.stage_megabytes.get(stage, 0.0), round(_peak()))


def _peak() -> float:
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
    except (OSError, StopIteration):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def started() -> float:
    """Processor seconds from the start of this process until all is imported that a run needs."""
    for name in HEAVY:
        importlib.import_module(name)
    return time.process_time()


def libigl_seconds(points: Floats, part: Mesh) -> float:
    """Processor seconds of libigl's exact signed distance from points (N,3) to the part.

    What any method has to do that compares a scan with a CAD model point by point, so a yardstick for its cost that
    carries over from machine to machine.
    """
    from damageest.geometry.distance import run_libigl_pass

    some = points[:: -(-len(points) // YARDSTICK)]
    origin = part.bounds.mean(0)
    places, mesh = np.ascontiguousarray(some - origin), Mesh(part.vertices - origin, part.faces)
    start = time.process_time()
    run_libigl_pass(places, mesh)
    return (time.process_time() - start) * len(points) / len(some)
