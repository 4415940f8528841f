"""A job made ready for runs with one stage swapped: its part, scan and truth as arrays and files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Floats, Part
from damageest.errors import Fault, JobError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.io.meshes import write_points, write_stl
from damageest.job import load
from damageest.pipeline.prepare import read_inputs
from damageest.registry import Implementation, Registry
from damageest.registry.contracts import SURFACE_ONLY
from damageest.stages.enclose import EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan

OFF_DEGREES, OFF_SHARE = 3.0, 0.01
"""By how much the scan is turned and shifted, of the part's diagonal, for an `align` that needs a start."""


@dataclass(frozen=True)
class Scene:
    """A job and what was made of it in ``folder``: scene.npz, part.stl, scan.ply, specimen.ply (a scan of the undamaged
    part). ``values`` is the job as a mapping; ``pose`` (4,4) the true ``T_part_scan``."""

    name: str
    folder: Path
    values: Mapping[str, Any]
    part_path: str
    bounds: Floats
    pose: Floats


def prepared(path: Path, registry: Registry, folder: Path) -> Scene:
    """Raises JobError where the job is at fault or its scan is not simulated."""
    job = load(path, registry)
    part, scan = read_inputs(job, registry)
    if scan.truth is None or scan.truth.damage is None:
        raise JobError(
            [Fault("the truth is not known; give a job with  scan: {use: simulate, damage: [...]}")], str(path)
        )
    folder.mkdir(parents=True)
    lost = scan.truth.damage
    np.savez(
        folder / "scene.npz",
        vertices=part.vertices,
        faces=part.faces,
        unit=part.unit,
        points=scan.points,
        lost=lost.vertices,
        lost_faces=lost.faces,
        pose=scan.truth.T_part_scan,
    )
    write_stl(folder / "part.stl", part)
    noise = measure_noise_and_spacing(scan.points)[0]
    for name, points in (("scan", scan.points), ("specimen", _specimen(part, len(scan.points), noise))):
        x, y, z = points.T
        write_points(folder / f"{name}.ply", {"x": x, "y": y, "z": z})
    values = {"version": 1, "units": job.units, "tolerance": job.tolerance or "auto"}
    values["scan"] = job.stages[ReadScan].model_dump(mode="json")
    return Scene(
        job.name, folder, values, str(getattr(job.stages[ReadPart], "path", "")), part.bounds, scan.truth.T_part_scan
    )


def settings_for(item: Implementation, scene: Scene) -> dict[str, Any] | str:
    """The job with this implementation in it, and what is handed in beside it; a sentence where it does not apply."""
    stage, use = item.contract.stage, item.name
    options: dict[str, Any] = {"use": use}
    job: dict[str, Any] = {key: value for key, value in scene.values.items() if key != "scan"}
    own_part, own_scan, moved = item.contract is ReadPart, item.contract is ReadScan, np.eye(4)
    if stage == "part":
        choices = {"file": "part.stl", "reconstruct": "specimen.ply"}
        if use not in choices and not scene.part_path.endswith(tuple(item.cls.reads) or "\0"):
            return "the job's part is no file of that kind"
        options["path"] = str(scene.folder / choices[use]) if use in choices else scene.part_path
    elif stage == "scan":
        options = {**scene.values["scan"]} if use == "simulate" else {**options, "path": str(scene.folder / "scan.ply")}
    elif use == "build_volume":
        middle, extent = scene.bounds.mean(axis=0), 1.5 * np.ptp(scene.bounds, axis=0) + 10
        options |= {"size": extent.tolist(), "corner": (middle - extent / 2).tolist()}
    elif stage == "align" and use != "register":
        moved = _off(scene) @ scene.pose if use == "icp" else scene.pose
    missing = [name for name, field in item.cls.model_fields.items() if field.is_required() and name not in options]
    if missing:
        return f"needs {', '.join(missing)}"
    if item.contract in SURFACE_ONLY:
        job["method"] = "surface"
    elif item.contract is EncloseAll:
        job["method"] = item.method
    return {
        "job": {**job, stage: options},
        "own_part": own_part,
        "own_scan": own_scan,
        "moved": moved.tolist(),
    }


def _off(scene: Scene) -> Floats:
    """A small rigid move about the part's centre."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([OFF_DEGREES, 0, 0], degrees=True).as_matrix()
    centre = scene.bounds.mean(axis=0)
    T[:3, 3] = centre - T[:3, :3] @ centre
    T[0, 3] += OFF_SHARE * float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    return T


def _specimen(part: Part, points: int, noise: float) -> Floats:
    from damageest.stages.scan.simulate import Simulate

    return Simulate(points=points, noise=noise, seed=77).run("mm", part).points
