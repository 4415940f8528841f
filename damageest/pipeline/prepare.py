"""Steps between reading the inputs and finding damage: noise, tolerance, the scan in the part's frame."""

from __future__ import annotations

from dataclasses import replace

from damageest.artefacts import INTACT, Part, Scan
from damageest.checks.scan_quality import choose_tolerance
from damageest.errors import InputError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.units import diagnose_scale
from damageest.job.model import Job
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, follow, start
from damageest.pipeline.state import JobState, Work
from damageest.registry.registry import Registry
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan


def measure_scan(engine: Engine, work: Work) -> Work:
    """Measures the scan's noise and spacing and chooses the tolerance. Raises InputError for a scan of another size."""
    state = work.job
    scan, part = state.scan, state.part
    if wrong_size := diagnose_scale(scan.points, part.vertices, part.unit):
        raise InputError(f"scan: {wrong_size}")
    if not scan.noise:
        key = digest("measure", state.key("scan"))
        _, (noise, spacing) = engine.remember("measure", key, lambda: measure_noise_and_spacing(scan.points))
        scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, warnings = choose_tolerance(engine.job.tolerance, scan, part)
    state = state.derive(JobState.scan, scan, JobState.scan)
    state = state.with_value(JobState.tolerance, tolerance, digest(tolerance))
    return replace(work, job=state, warnings=(*work.warnings, *warnings))


def place_scan(engine: Engine, work: Work) -> Work:
    """Brings the scan into the part's frame."""
    state = work.job
    pose, scan = state.pose, state.scan
    state = state.derive(JobState.aligned, scan.move(pose.T_part_scan), JobState.scan, JobState.pose)
    state = state.derive(JobState.noise, scan.noise, JobState.scan)
    state = state.derive(JobState.spacing, scan.spacing, JobState.scan)
    return replace(work, job=state, warnings=(*work.warnings, *pose.notes))


def gather_intact(engine: Engine, work: Work) -> Work:
    """Gathers the intact points, which tell the enclosures what is still there."""
    state = work.job
    intact = state.aligned.points[state.deviation.label == INTACT]
    state = state.derive(JobState.intact, intact, JobState.aligned, JobState.deviation)
    return replace(work, job=state, warnings=(*work.warnings, *state.deviation.notes, *state.sites.notes))


def read_inputs(job: Job, registry: Registry) -> tuple[Part, Scan]:
    """The part and the scan of a job, as their stages read them."""
    state = follow((ReadPart, ReadScan), Engine(job, registry), start(job)).job
    return state.part, state.scan


def inspect_inputs(job: Job, registry: Registry) -> tuple[Part, Scan, float, list[str]]:
    """Part, measured scan, a tolerance for them, and what is doubtful; for a new job."""
    part, scan = read_inputs(job, registry)
    doubts = [doubt] if (doubt := diagnose_scale(scan.points, part.vertices, part.unit)) else []
    noise, spacing = measure_noise_and_spacing(scan.points)
    scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, more = choose_tolerance(None, scan, part)
    return part, scan, tolerance, doubts + more
