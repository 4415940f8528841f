"""The input files of a job for the matrix, and the job's settings with the implementation of one stage replaced."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from damageest import read_inputs, run
from damageest.artefacts import Floats, Part, Scan, Solid
from damageest.errors import Fault, JobError, StageError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.io.meshes import write_points, write_stl
from damageest.job import load
from damageest.registry import Implementation, Registry
from damageest.registry.contracts import SURFACE_ONLY
from damageest.stages.adapt import Adapt
from damageest.stages.align import Align
from damageest.stages.enclose import EncloseAll
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan

KEPT = (Align, Adapt)
"""Contracts whose implementation stays that of the job: without it, its scan would not fit its part."""
EARLY = ("part-", "scan-", "measure_scan-", "sample-", "align-", "adapt-", "segment-", "cluster-")
"""What names the entries that the cells of the later stages share."""
OFF_DEGREES, OFF_SHARE = 3.0, 0.01
"""Rotation, and shift as a share of the part's diagonal, of the scan for an `align` that needs a start pose."""


@dataclass(frozen=True)
class MatrixJob:
    """A job and its files in ``folder``: scene.npz, part.stl, scan.ply, specimen.ply (a scan of the intact part).

    ``name`` ends with a star where its own result stands for the true damage. ``values``: the job as a mapping.
    ``bounds`` (2,3): of the part. ``pose`` (4,4): the true ``T_part_scan``.
    """

    name: str
    folder: Path
    values: Mapping[str, Any]
    part_path: str
    bounds: Floats
    pose: Floats


def prepare_matrix_job(path: Path, registry: Registry, folder: Path) -> MatrixJob:
    """Reads a job and writes its files.

    Where the true damage is not known, that of a run with the job's own stages stands for it. Raises JobError if the
    job is invalid, and any error of that run.
    """
    job = load(path, registry)
    part, scan = read_inputs(job, registry)
    truth = scan.truth
    known = truth is not None and truth.damage is not None
    damage, pose = (truth.damage, truth.T_part_scan) if truth and truth.damage else _run_default(path, registry)
    folder.mkdir(parents=True)
    np.savez(
        folder / "scene.npz",
        vertices=part.vertices,
        faces=part.faces,
        unit=part.unit,
        points=scan.points,
        lost=damage.vertices,
        lost_faces=damage.faces,
        pose=pose,
    )
    write_stl(folder / "part.stl", part)
    _write_scans(part, scan, folder)
    kept = {one.stage: job.stages[one].model_dump(mode="json") for one in KEPT}
    values = {"version": 1, "units": job.units, "tolerance": job.tolerance or "auto", **kept}
    _compute_early_stages(values, folder, registry)
    values["scan"] = job.stages[ReadScan].model_dump(mode="json")
    return MatrixJob(
        job.name if known else f"{job.name}*",
        folder,
        values,
        str(getattr(job.stages[ReadPart], "path", "")),
        part.bounds,
        pose,
    )


def load_scene(folder: Path, move: Floats) -> tuple[Part, Scan, Solid, Floats]:
    """Part, scan moved by ``move`` (4,4), true damage and true pose of that scan, as a matrix job keeps them."""
    data = np.load(folder / "scene.npz")
    unit = str(data["unit"])
    part, scan = Part(data["vertices"], data["faces"], unit=unit), Scan(data["points"], unit=unit)
    return part, scan.move(move), Solid(data["lost"], data["lost_faces"]), data["pose"] @ np.linalg.inv(move)


def _compute_early_stages(values: Mapping[str, Any], folder: Path, registry: Registry) -> None:
    """Leaves in ``folder``/early what the stages up to the sites give, for the cells to start from."""
    part, scan, _, _ = load_scene(folder, np.eye(4))
    settings = ["method=surface", "report=none", "accept=all"]
    with contextlib.suppress(StageError):  # what a site fails with is said by the cells
        run(values, part=part, scan=scan, settings=settings, registry=registry, output=folder / "early")
    for entry in (folder / "early" / "stages").glob("*"):
        if not entry.name.startswith(EARLY):
            entry.unlink()


def _run_default(path: Path, registry: Registry) -> tuple[Solid, Floats]:
    """The damage and the pose that the job finds with its own stages."""
    result = run(path, settings=["path=none", "report=none"], registry=registry, output=False)
    if not isinstance(result.damage, Solid):
        raise JobError([Fault("neither is the true damage known, nor does the job find any")], str(path))
    return result.damage, result.pose.T_part_scan


def _write_scans(part: Part, scan: Scan, folder: Path) -> None:
    noise = measure_noise_and_spacing(scan.points)[0]
    for name, points in (("scan", scan.points), ("specimen", _scan_specimen(part, len(scan.points), noise))):
        x, y, z = points.T
        write_points(folder / f"{name}.ply", {"x": x, "y": y, "z": z})


def make_settings(item: Implementation | None, scene: MatrixJob) -> dict[str, Any] | str:
    """The inputs of `matrix.run_one` with this implementation, or with the default of each stage (None); or the reason
    if it does not apply to the job."""
    job: dict[str, Any] = {key: value for key, value in scene.values.items() if key != "scan"}
    if item is None:
        return {"job": job, "own_part": False, "own_scan": False, "moved": np.eye(4).tolist()}
    stage, use = item.contract.stage, item.name
    options: dict[str, Any] = {"use": use}
    own_part, own_scan, moved = item.contract is ReadPart, item.contract is ReadScan, np.eye(4)
    if stage == "part":
        choices = {"file": "part.stl", "reconstruct": "specimen.ply", "earlier_scan": "specimen.ply"}
        if use not in choices and not scene.part_path.endswith(tuple(item.cls.reads) or "\0"):
            return "does not read the file format of the job's part"
        options["path"] = str(scene.folder / choices[use]) if use in choices else scene.part_path
    elif stage == "scan":
        options = {**scene.values["scan"]} if use == "simulate" else {**options, "path": str(scene.folder / "scan.ply")}
    elif use == "build_volume":
        middle, extent = scene.bounds.mean(axis=0), 1.5 * np.ptp(scene.bounds, axis=0) + 10
        options |= {"size": extent.tolist(), "corner": (middle - extent / 2).tolist()}
    elif use == "points":
        options["pairs"] = _pick_pairs(scene)
    elif stage == "path" and use == "layers":
        width = float(np.linalg.norm(np.ptp(scene.bounds, axis=0))) / 40
        nozzle = {"tip_radius": width / 2, "length": 20 * width, "body_radius": 3 * width}
        options |= {"width": width, "height": width / 2, "feed": 600.0, "nozzle": nozzle}
    elif stage == "align" and use != "register":
        moved = _make_small_motion(scene) @ scene.pose if use in ("icp", "constrained") else scene.pose
        options |= {"shift": ["x", "y", "z"], "turn": ["x", "y", "z"]} if use == "constrained" else {}
    missing = [name for name, field in item.cls.model_fields.items() if field.is_required() and name not in options]
    if missing:
        return f"has no default for: {', '.join(missing)}"
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


def _pick_pairs(scene: MatrixJob) -> list[list[list[float]]]:
    """Four corners of the part's bounds, in the scan and on the part."""
    low, high = scene.bounds
    corners = np.where([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], high, low)
    back = np.linalg.inv(scene.pose)
    return [[(back[:3, :3] @ corner + back[:3, 3]).tolist(), corner.tolist()] for corner in corners]


def _make_small_motion(scene: MatrixJob) -> Floats:
    """A small rotation about the part's centre and a small shift, as (4,4)."""
    from scipy.spatial.transform import Rotation

    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec([OFF_DEGREES, 0, 0], degrees=True).as_matrix()
    centre = scene.bounds.mean(axis=0)
    T[:3, 3] = centre - T[:3, :3] @ centre
    T[0, 3] += OFF_SHARE * float(np.linalg.norm(np.ptp(scene.bounds, axis=0)))
    return T


def _scan_specimen(part: Part, points: int, noise: float) -> Floats:
    """(N,3) points of a scan of the intact part."""
    from damageest.stages.scan.simulate import Simulate

    return Simulate(points=points, noise=noise, seed=77).run("mm", part).points
