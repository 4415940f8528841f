"""Steps between reading the inputs and finding damage: noise, tolerance, the scan in the part's frame."""

from __future__ import annotations

import math
from dataclasses import replace

from damageest.artefacts import INTACT, Part, Reason, Scan
from damageest.checks.scan_quality import check_walls, choose_tolerance, describe_few, raise_tolerance, require_intact
from damageest.errors import InputError, StageError
from damageest.geometry.crops import crop_points
from damageest.geometry.depth_steps import measure_depth_step
from damageest.geometry.distance import signed_distance
from damageest.geometry.far_points import find_far
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.units import diagnose_scale, diagnose_size
from damageest.job.model import Job
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, follow, start
from damageest.pipeline.large_scans import check_crops
from damageest.pipeline.state import JobState, Work
from damageest.registry.registry import Registry
from damageest.rules.notes import make_notes
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan
from damageest.stages.segment import Segment

COMPARED = 20_000
"""Points that the tolerance is chosen from after the alignment."""


def crop_scan(engine: Engine, work: Work) -> Work:
    """Removes the points that the job's crops remove. Raises InputError where no point is left."""
    stage = engine.job.stages.get(ReadScan)
    if not isinstance(stage, ReadScan) or not stage.crop:
        return work
    state = work.job
    if state.scan.total:
        check_crops(stage.crop)
    return replace(work, job=state.derive(JobState.scan, crop_points(state.scan, stage.crop), JobState.scan))


def set_far_aside(engine: Engine, work: Work) -> Work:
    """Removes points that are too far from all others to be of the part, and says how many."""
    state = work.job
    far = find_far(state.scan.points, state.part.diagonal)
    if not far.any():
        return work
    text = (
        f"{int(far.sum())} scan points were set aside, since they are farther from all others than the part is "
        f"large ({state.part.diagonal:.4g} {state.part.unit}), and few"
    )
    scan = state.scan.take(~far)
    scan = replace(scan, notes=(*scan.notes, text))
    state = state.derive(JobState.scan, scan, JobState.scan, JobState.part)
    return replace(work, job=state, warnings=(*work.warnings, Reason("far_points", text, amount=int(far.sum()))))


def measure_scan(engine: Engine, work: Work) -> Work:
    """Measures the scan's noise and spacing and chooses the tolerance. Raises InputError for a scan of another size."""
    state = work.job
    scan, part = state.scan, state.part
    if wrong_size := diagnose_scale(scan.points, part.vertices, part.unit):
        raise InputError(f"scan: {wrong_size}")
    step = 0.0
    if not scan.noise:
        key = digest("measure with steps", state.key("scan"))
        _, (noise, spacing, step) = engine.remember("measure", key, lambda: _measure(scan))
        scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, warnings = choose_tolerance(engine.job.tolerance, scan, part, step)
    warnings = [*describe_few(scan), *warnings]
    if wrong_unit := diagnose_size(part.vertices, part.unit):
        warnings = [Reason("unit", wrong_unit), *warnings]
    state = state.derive(JobState.scan, scan, JobState.scan)
    state = state.with_value(JobState.tolerance, tolerance, digest(tolerance))
    return replace(work, job=state, warnings=(*work.warnings, *warnings))


def _measure(scan: Scan) -> tuple[float, float, float]:
    """Noise, spacing, and the step of the depth (0: continuous); rounding to steps counts as noise."""
    noise, spacing = measure_noise_and_spacing(scan.points)
    step = measure_depth_step(scan.points, scan.viewpoints, scan.view)
    return max(noise, step / math.sqrt(12)), spacing, step


def place_scan(engine: Engine, work: Work) -> Work:
    """Brings the scan into the part's frame."""
    state = work.job
    pose, scan = state.pose, state.scan
    state = state.derive(JobState.aligned, scan.move(pose.T_part_scan), JobState.scan, JobState.pose)
    state = state.derive(JobState.noise, scan.noise, JobState.scan)
    state = state.derive(JobState.spacing, scan.spacing, JobState.scan)
    return replace(work, job=state, warnings=(*work.warnings, *make_notes("align", pose.notes)))


def settle_tolerance(engine: Engine, work: Work) -> Work:
    """Where the tolerance is auto: raises it if intact surface deviates from the part by far more than the noise.
    Warns of a tolerance that the part's walls are too thin for."""
    state = work.job
    part, points, tolerance = state.part, state.aligned.points, state.tolerance
    warnings: list[Reason] = []
    if engine.job.tolerance is None and len(points):
        distance = signed_distance(points[:: max(1, math.ceil(len(points) / COMPARED))], part)[0]
        tolerance, warnings = raise_tolerance(tolerance, distance, part, state.noise)
        state = state.with_value(JobState.tolerance, tolerance, digest(tolerance))
    warnings += check_walls(tolerance, part)
    return replace(work, job=state, warnings=(*work.warnings, *warnings))


def check_intact(engine: Engine, work: Work) -> Work:
    """Stops with a StageError where too few points near the part are intact."""
    state = work.job
    try:
        require_intact(state.deviation.distance, state.tolerance, state.part)
    except StageError as error:
        error.stage, error.use = "segment", engine.job.implementations[Segment].name
        raise
    return work


def gather_intact(engine: Engine, work: Work) -> Work:
    """Gathers the intact points, which tell the enclosures what is still there."""
    state = work.job
    intact = state.aligned.points[state.deviation.label == INTACT]
    state = state.derive(JobState.intact, intact, JobState.aligned, JobState.deviation)
    notes = (*make_notes("segment", state.deviation.notes), *make_notes("cluster", state.sites.notes))
    return replace(work, job=state, warnings=(*work.warnings, *notes))


def read_part(job: Job, registry: Registry) -> Part:
    """The part of a job, as its stage reads it."""
    return Engine(job, registry).call(ReadPart, start(job).job).part


def read_inputs(job: Job, registry: Registry) -> tuple[Part, Scan]:
    """The part and the scan of a job, as their stages read them."""
    state = follow((ReadPart, ReadScan, crop_scan, set_far_aside), Engine(job, registry), start(job)).job
    return state.part, state.scan


def inspect_inputs(job: Job, registry: Registry) -> tuple[Part, Scan, float, list[Reason]]:
    """Part, measured scan, a tolerance for them, and what is doubtful; for a new job."""
    part, scan = read_inputs(job, registry)
    wrong = (diagnose_scale(scan.points, part.vertices, part.unit), diagnose_size(part.vertices, part.unit))
    doubts = [Reason("unit", text) for text in wrong if text]
    noise, spacing, step = _measure(scan)
    scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, more = choose_tolerance(None, scan, part, step)
    return part, scan, tolerance, doubts + more + check_walls(tolerance, part)
