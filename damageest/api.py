"""`damageest.run`: the whole route from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Part, Scan
from damageest.errors import InputError
from damageest.io.files import resolve_path, working_folder
from damageest.io.part_store import use_part_store
from damageest.isolation import Limits, keep_one_thread
from damageest.job import Job, load
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, follow, start
from damageest.pipeline.routes import WRITE, route_of
from damageest.pipeline.state import JobState
from damageest.pipeline.workspace import open_workspace
from damageest.registry import Registry
from damageest.registry.contracts import Contract
from damageest.result import Result
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan


@keep_one_thread()
def run(
    job: str | Path | Mapping[str, Any] | Job,
    *,
    part: Any = None,
    scan: Any = None,
    output: str | Path | bool = False,
    settings: Sequence[str] = (),
    cache: bool = True,
    registry: Registry | None = None,
    limits: Limits | None = None,
) -> Result:
    """Runs a job and gives its result; writes nothing unless ``output`` says where (True: where the job says).

    ``job``: a path, a mapping of the same shape, or a checked Job. ``part`` (a Part, a trimesh.Trimesh, or vertices and
    faces) and ``scan`` (a Scan, an (N,3) array, a trimesh mesh or point cloud) replace the job's files; both may
    also be in the mapping. ``settings`` are overrides such as ``"cluster.eps=0.4"``. Lengths are in the job's unit.
    ``limits`` of memory and time hold for stages that run in a process of their own, those that call a native library.
    As long as it runs, the linear algebra of numpy and scipy uses one thread in this process, so that the same job
    gives the same bytes on any number of cores.

    Raises JobError or InputError (job or input at fault) and StageError (a stage failed or refused).
    """
    registry, limits = registry or Registry.discover(), limits or Limits()
    if not isinstance(job, Job):
        source, given = _split(job, part, scan)
        job = load(source, registry, settings, given)
    with use_part_store(cache):
        if output is False:
            engine = Engine(job, registry, limits=limits)
            return follow(route_of(job.method), engine, start(engine)).result
        target = job.output if output is True else resolve_path(Path(output), working_folder())
        job = replace(job, stages={contract: stage.leave_out(target) for contract, stage in job.stages.items()})
        with open_workspace(target, cache) as place:
            engine = Engine(job, registry, place.cache, limits=limits)
            state = start(engine).with_value(JobState.folder, place.folder, digest(str(target)))
            state = state.with_value(JobState.target, target, digest(str(target)))
            result = follow((*route_of(job.method), *WRITE), engine, state).result
            place.finish(engine.stems)
        return result


def _split(
    job: str | Path | Mapping[str, Any], part: Any, scan: Any
) -> tuple[str | Path | Mapping[str, Any], dict[Contract, Any]]:
    """The job without its arrays, and the artefacts made from them."""
    source: Any = dict(job) if isinstance(job, Mapping) else job
    units = str(source.get("units", "mm")) if isinstance(source, dict) else "mm"
    if isinstance(source, dict):
        for key, value in source.items():
            if isinstance(value, Path):
                source[key] = str(value)
        part = source.pop("part") if part is None and _is_data(source.get("part")) else part
        scan = source.pop("scan") if scan is None and _is_data(source.get("scan")) else scan
    given: dict[Contract, Any] = {}
    if part is not None:
        given[ReadPart] = _as_part(part, units)
    if scan is not None:
        given[ReadScan] = _as_scan(scan, units)
    return source, given


def _is_data(value: Any) -> bool:
    """Whether a value of `part` or `scan` holds the data itself rather than the name of a file or an implementation."""
    names_files = isinstance(value, list) and all(isinstance(item, (str, Path)) for item in value)
    return not (value is None or isinstance(value, (str, Path, Mapping)) or names_files)


def _as_part(value: Any, units: str) -> Part:
    from damageest.geometry.make_part import make_part

    if isinstance(value, Part):
        return value
    if hasattr(value, "vertices") and hasattr(value, "faces"):
        value = (value.vertices, value.faces)
    if not (isinstance(value, (tuple, list)) and len(value) == 2):
        raise InputError(f"part: give a Part, a trimesh.Trimesh, or (vertices, faces); not a {type(value).__name__}")
    return make_part(np.asarray(value[0], float), np.asarray(value[1], np.int64), unit=units)


def _as_scan(value: Any, units: str) -> Scan:
    if isinstance(value, Scan):
        return value
    points = np.asarray(getattr(value, "vertices", value), dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InputError(f"scan: give points of shape (N,3), N > 0; not {points.shape}")
    if not np.isfinite(points).all():
        raise InputError(f"scan: {int((~np.isfinite(points).all(1)).sum())} of its points are not finite; remove them")
    return Scan(points, unit=units)
