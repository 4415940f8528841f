"""A small damaged box and its scan as files, small enough to run the whole route in every test."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import trimesh

from damageest.artefacts import Part
from damageest.io.meshes import write_points
from damageest.stages.scan.simulate import Simulate

SIZE = (40.0, 30.0, 20.0)
TRUE_VOLUME = np.pi * 6**3 * 2 / 3
"""mm3 of the half ball of radius 6 removed from the top."""
JOB = "version: 1\ntolerance: 0.2\nalign: none\npart: box.stl\nscan: scan.ply\nreport: none\n"


def box() -> Part:
    mesh = trimesh.creation.box(SIZE)
    return Part(mesh.vertices, mesh.faces)


@cache
def scan(points: int = 20_000) -> np.ndarray:
    """Points (N,3) of the damaged box, which nobody changes."""
    tool = {"tool": "sphere", "centre": [0, 0, SIZE[2] / 2], "radius": 6}
    scanner = Simulate.model_validate({"damage": [tool], "points": points, "noise": 0.04})
    drawn = np.asarray(scanner.run("mm", box()).points)
    drawn.flags.writeable = False
    return drawn


def write_small(folder: Path, more: str = "") -> Path:
    """As `write`, for tests of what happens around a run: coarse and sparse, in less than half the time.

    ``more``: lines of the job.
    """
    return write(folder, JOB.replace("tolerance: 0.2", "tolerance: 0.4") + more, 6000)


def write_least(folder: Path, more: str = "") -> Path:
    """As `write_small`, with 2000 points: its volume is right within a few per cent."""
    return write(folder, JOB.replace("tolerance: 0.2", "tolerance: 0.6") + more, 2000)


def write(folder: Path, job: str = JOB, points: int = 20_000) -> Path:
    """Writes part, scan and job; gives the job's path."""
    folder.mkdir(parents=True, exist_ok=True)
    trimesh.creation.box(SIZE).export(folder / "box.stl")
    x, y, z = scan(points).T
    write_points(folder / "scan.ply", {"x": x, "y": y, "z": z})
    path = folder / "job.yaml"
    path.write_text(job)
    return path


def content(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its relative path."""
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}
