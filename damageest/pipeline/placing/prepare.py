"""Steps between reading the inputs and finding damage: noise, tolerance, the scan in the part's frame."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from damageest.artefacts import Part, Pose, Reason, Scan, Sites
from damageest.errors import DamageestError, InputError
from damageest.geometry.crops import crop_points
from damageest.geometry.depth_steps import measure_depth_step
from damageest.geometry.distance import signed_distance
from damageest.geometry.far_points import find_far
from damageest.geometry.filled import find_filled
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.geometry.pieces_of_part import is_piece
from damageest.geometry.scan_field import ScanField
from damageest.geometry.units import diagnose_scale, diagnose_size, question_size
from damageest.job.model import Job
from damageest.pipeline.begin import start
from damageest.pipeline.cache import Cache
from damageest.pipeline.engine import Engine, follow
from damageest.pipeline.placing.large_scans import check_crops
from damageest.pipeline.placing.shared import keep_shared
from damageest.pipeline.state import Reasons
from damageest.pipeline.steps import step
from damageest.pipeline.workspace import is_in_use
from damageest.registry.registry import Registry
from damageest.stages.align import Align
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan
from damageest.trust.scan_quality import (
    check_walls,
    choose_tolerance,
    describe_few,
    raise_tolerance,
    require_real_clusters,
)

COMPARED = 20_000
"""Points that the tolerance is chosen from after the alignment."""


@step(gives=("scan", "warnings"))
def clean_scan(scan: Scan, part: Part, reader: ReadScan | None, unit: str) -> tuple[Scan, Reasons]:
    """The scan as it is meant, without what the job crops and what is far from all else; what the reader says of it."""
    scan = choose_columns(scan, part, reader, unit)
    told = scan.warnings
    scan, far = set_far_aside(crop_scan(scan, reader), part)
    return scan, (*told, *far)


def choose_columns(scan: Scan, part: Part, reader: ReadScan | None, unit: str) -> Scan:
    """Where the scan is not of the part's size, and its files may be meant otherwise: the one way that is, with a
    warning. Raises InputError where several are."""
    if reader is None or not scan.columns or not diagnose_scale(scan.points, part.vertices, part.unit):
        return scan
    others = list(reader.read_otherwise(unit))
    fits = [one for one in others if not diagnose_scale(one.points, part.vertices, part.unit)]
    if len(fits) > 1:
        ways = ", or ".join(f"columns: '{one.columns[0]}'" for one in fits)
        raise InputError(
            f"scan: {'; '.join(scan.columns)}, but their size is not the part's; with others it is: give {ways}"
        )
    if not fits:
        return scan
    text = (
        f"{'; '.join(scan.columns)}, but their size does not fit the part: the scan was read as "
        f"columns: '{fits[0].columns[0]}', which fits"
    )
    remedy = "name the columns in scan.columns"
    return replace(fits[0], warnings=(*fits[0].warnings, Reason("columns", text, remedy=remedy)))


def crop_scan(scan: Scan, reader: ReadScan | None) -> Scan:
    """Removes the points that the job's crops remove. Raises InputError where no point is left."""
    if reader is None or not reader.crop:
        return scan
    if scan.total:
        check_crops(reader.crop)
    return crop_points(scan, reader.crop)


def set_far_aside(scan: Scan, part: Part) -> tuple[Scan, Reasons]:
    """Removes points that are too far from all others to be of the part, and says how many."""
    far = find_far(scan.points, part.diagonal)
    if not far.any():
        return scan, ()
    text = (
        f"{int(far.sum())} stray scan points were removed, farther than {part.diagonal:.4g} {part.unit} from all others"
    )
    scan = scan.take(~far)
    return replace(scan, notes=(*scan.notes, text)), [
        Reason("far_points", text, amount=int(far.sum()), remedy="delete them in the scanner's software")
    ]


@step(gives=("measured_noise", "measured_spacing", "depth_step"), kept=True)
def measure_scan(scan: Scan, part: Part, aligner: Align | None) -> tuple[float, float, float]:
    """Measures noise and spacing of the scan, and the step of its depth. Raises InputError for one of another size, but
    for a piece of the part in a known pose."""
    wrong_size = diagnose_scale(scan.points, part.vertices, part.unit)
    known = None if aligner is None else aligner.known_pose
    if wrong_size and not (known is not None and is_piece(scan.points, part, known)):
        raise InputError(f"scan: {wrong_size}{describe_columns(scan)}", topic="unit")
    return (scan.noise, scan.spacing, 0.0) if scan.noise else _measure(scan)


def describe_columns(scan: Scan) -> str:
    """The end of a message about a scan that does not fit the part: what was taken for x, y and z; empty where a file
    leaves no choice."""
    if not scan.columns:
        return ""
    return f"; {'; '.join(scan.columns)}: if they are others, give scan.columns"


@step(gives=("tolerance", "warnings"))
def take_tolerance(
    scan: Scan,
    part: Part,
    measured_noise: float,
    measured_spacing: float,
    depth_step: float,
    asked_tolerance: float | None,
) -> tuple[float, Reasons]:
    """Takes the tolerance of the job, or one for the scan as it was measured."""
    scan = replace(scan, noise=measured_noise, spacing=measured_spacing)
    tolerance, warnings = choose_tolerance(asked_tolerance, scan, part, depth_step)
    warnings = [*describe_few(scan), *warnings]
    if wrong_unit := diagnose_size(part.vertices, part.unit):
        warnings = [Reason("unit", wrong_unit), *warnings]
    return tolerance, warnings


@step(gives=("scan", "warnings"))
def remove_filled_points(scan: Scan, measured_noise: float, measured_spacing: float) -> tuple[Scan, Reasons]:
    """The scan with what was measured of it, without points that software put where the scanner saw nothing; how many
    these are."""
    scan = replace(scan, noise=measured_noise, spacing=measured_spacing)
    filled = find_filled(scan.points, scan.noise)
    if not filled.any():
        return scan, ()
    x, y, z = np.median(scan.points[filled], axis=0)
    text = (
        f"{int(filled.sum()):,} scan points ({filled.mean():.1%}) near ({x:.3g}, {y:.3g}, {z:.3g}) were removed: a "
        "sheet with a tenth of the usual noise, like a filled hole"
    )
    remedy = "export the scan without filled holes (not watertight)"
    scan = scan.take(~filled)
    reason = Reason("filled_points", text, amount=int(filled.sum()), remedy=remedy)
    return replace(scan, notes=(*scan.notes, text)), [reason]


def _measure(scan: Scan) -> tuple[float, float, float]:
    """Noise, spacing, and the step of the depth (0: continuous); rounding to steps counts as noise."""
    noise, spacing = measure_noise_and_spacing(scan.points)
    step = measure_depth_step(scan.points, scan.viewpoints, scan.view)
    return max(noise, step / math.sqrt(12)), spacing, step


@step(gives=("scan", "aligned", "warnings"))
def place_scan(scan: Scan, pose: Pose, part: Part, tolerance: float, unit: str) -> tuple[Scan, Scan, Reasons]:
    """Brings the scan into the part's frame. Where an earlier scan stands for the part, points on skin that it does not
    show are left out."""
    aligned = scan.move(pose.T_part_scan)
    return keep_shared(scan, aligned, part, tolerance, unit)


@step(gives=("tolerance", "warnings"))
def settle_tolerance(
    tolerance: float, asked_tolerance: float | None, part: Part, aligned: Scan
) -> tuple[float, Reasons]:
    """Where the tolerance is auto: raises it if intact surface deviates from the part by far more than the noise.
    Warns of a tolerance that the part's walls are too thin for."""
    points = aligned.points
    warnings: list[Reason] = []
    if asked_tolerance is None and len(points):
        distance = signed_distance(points[:: max(1, math.ceil(len(points) / COMPARED))], part)[0]
        tolerance, warnings = raise_tolerance(tolerance, distance, part, aligned.noise)
    if diagnose_size(part.vertices, part.unit) is None and (tiny := question_size(tolerance, part.vertices, part.unit)):
        warnings = [*warnings, Reason("unit", tiny)]
    return tolerance, [*warnings, *check_walls(tolerance, part)]


@step()
def check_clusters(sites: Sites, field: ScanField) -> None:
    """Stops with an InputError where noise alone makes very many clusters, before each of them costs an enclosure."""
    require_real_clusters(sites, field.deviation, field.tolerance, field.part)


def read_part(job: Job, registry: Registry) -> Part:
    """The part of a job, as its stage reads it."""
    engine = Engine(job, registry)
    return engine.call(ReadPart, start(engine)).part


def read_inputs(job: Job, registry: Registry, memo: dict[str, Any] | None = None) -> tuple[Part, Scan]:
    """The part and the scan of a job, as their stages read them; ``memo`` takes them by the keys of what was read."""
    engine = Engine(job, registry, memo={} if memo is None else memo)
    state = follow((ReadPart, ReadScan, clean_scan), engine, start(engine))
    return state.part, state.scan


def inspect_inputs(
    job: Job, registry: Registry, memo: dict[str, Any] | None = None
) -> tuple[Part, Scan, float, list[Reason]]:
    """Part, measured scan, a tolerance for them, and what is doubtful; for a new job. ``memo``: as `read_inputs`."""
    part, scan = read_inputs(job, registry, memo)
    wrong = (diagnose_scale(scan.points, part.vertices, part.unit), diagnose_size(part.vertices, part.unit))
    doubts = [*scan.warnings, *(Reason("unit", text) for text in wrong if text)]
    noise, spacing, step = _measure(scan)
    scan = replace(scan, noise=noise, spacing=spacing)
    tolerance, more = choose_tolerance(None, scan, part, step)
    return part, scan, tolerance, doubts + more + check_walls(tolerance, part)


def keep_inputs(job: Job, registry: Registry, memo: dict[str, Any]) -> bool:
    """Keeps part and scan in the output folder of a job as its first run will ask for them, and says whether it did.

    ``memo``: what was read already. A part whose triangles depend on the tolerance is read again where the job's is
    another. Nothing is kept where the output folder holds other files, is in use, or cannot be written to.
    """
    try:
        if is_in_use(job.output):
            return False
        engine, cache = Engine(job, registry, memo=memo), Cache(job.output / "stages")
        state = start(engine)
        for contract in (ReadPart, ReadScan):
            state = engine.call(contract, state)
            cache.put(contract.stage, state.key(contract.gives), state.get(contract.gives))
    except (DamageestError, OSError):  # the run says what is wrong
        return False
    return True
