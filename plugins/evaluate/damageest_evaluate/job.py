"""The cases of `damageest evaluate job`: random damages of given depths on the user's part, with a similar scanner."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from damageest import read_inputs, read_part
from damageest.artefacts import Part
from damageest.errors import InputError
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.io.digests import digest
from damageest.io.files import file_sha256
from damageest.job import Job, load
from damageest.registry import Registry
from damageest.stages.align import Align
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan
from damageest.stages.scan.simulate import Simulate
from damageest.trust.scan_quality import choose_tolerance
from damageest_evaluate.case import DamageCase, save_part
from damageest_evaluate.damages import KINDS
from damageest_evaluate.sized import SIZED
from damageest_evaluate.variants import Baseline, Variant, VariationRequest, make_variants

SIZES = (0, 2, 4, 8, 16)
"""Default depths of the damage, in tolerances; 0: an intact part."""
DEEPEST = 0.1
"""Largest default depth, as a share of the part's diagonal."""


@dataclass(frozen=True)
class Study:
    """The cases of a job, and in ``notes`` a description of the part and the scanner."""

    cases: list[DamageCase]
    unit: str
    notes: tuple[str, ...]


def plan_study(path: Path, request: VariationRequest, seeds: int, registry: Registry, folder: Path) -> Study:
    """Plans the cases of a job and saves its part in ``folder``.

    Raises JobError or InputError if the job, its files or the variation is invalid.
    """
    job = load(path, registry, request.settings)
    part, scanner, notes = _read_inputs(job, registry)
    tolerance = job.tolerance or _choose_tolerance(part, scanner)
    if not request.size:
        fitting = [size for size in SIZES if size * tolerance <= DEEPEST * part.diagonal]
        request = replace(request, size=",".join(f"{size}x" for size in fitting))
    uses = {contract.stage: item.name for contract, item in job.implementations.items()}
    base = Baseline(job.units, scanner, tolerance, job.tolerance is None, False, uses)
    ways = make_variants(request, base)
    for way in ways:
        check_variant(path, way, part, registry)
    save_part(part, folder / "part.npz")
    source = digest(fingerprint_code(registry), file_sha256(path), part.vertices, part.faces)
    cases = [_make_case(way, seed, job, path, source, folder) for seed in range(seeds) for way in ways]
    scanner_text = (
        f"{scanner['points']} points, noise {scanner['noise']:.4g} {job.units}, tolerance {tolerance:.4g} {job.units}"
    )
    return Study(cases, job.units, (f"{job.name}: part {part.diagonal:.4g} {job.units} across, {scanner_text}", *notes))


def fingerprint_code(registry: Registry) -> str:
    """A digest of the code of damageest and its plugins. Rows that other code computed are not used again."""
    return digest(*(provider.fingerprint for provider in registry.providers))


def check_variant(job: Path | dict[str, Any], way: Variant, part: Part, registry: Registry) -> None:
    """Raises JobError if the variant gives no valid job. Called for all variants before the first run."""
    scan = "scan=" + json.dumps({"use": "simulate", **way.scanner})
    load(job, registry, [*way.settings, scan], {ReadPart: part})


def _make_case(way: Variant, seed: int, job: Job, path: Path, source: str, folder: Path) -> DamageCase:
    kinds = SIZED if way.size else tuple(KINDS)
    return DamageCase(
        part=job.name,
        seed=seed,
        first=kinds[seed % len(kinds)],
        tolerance=way.tolerance,
        size=way.size,
        scanner=way.scanner,
        settings=way.settings,
        varied=way.varied,
        source=source,
        job=str(path.resolve()),
        file=str(folder / "part.npz"),
    )


def _choose_tolerance(part: Part, scanner: dict[str, Any]) -> float:
    from damageest.artefacts import Scan

    empty = Scan(part.vertices[:1], noise=scanner["noise"])
    return choose_tolerance(None, empty, part)[0]


def _read_inputs(job: Job, registry: Registry) -> tuple[Part, dict[str, Any], tuple[str, ...]]:
    """The part, the options of a virtual scanner similar to the job's scan, and notes."""
    reader = job.stages[ReadScan]
    if isinstance(reader, Simulate):
        part = read_part(job, registry)
        scanner = reader.model_dump(mode="json", exclude={"use", "damage", "seed"})
        return part, {**scanner, "noise": 0.0005 * part.diagonal if reader.noise is None else reader.noise}, ()
    part, scan = read_inputs(job, registry)
    points = scan.points
    noise, spacing = measure_noise_and_spacing(points)
    if not spacing:
        raise InputError(f"scan: noise and spacing cannot be measured, {len(points)} points are too few")
    known = job.implementations[Align].name != "register"
    scanner = {"points": len(points), "noise": float(f"{noise:.4g}"), "pose": "identity" if known else "random"}
    # the number of points that gives this spacing on the whole part: the job's scan may cover only a half of it, or
    # a fixture too
    trial = Simulate.model_validate(scanner).run(part.unit, part).points
    scanner["points"] = round(len(points) * (measure_noise_and_spacing(trial)[1] / spacing) ** 2)
    note = f"measured in the job's scan: noise {noise:.3g} {job.units}, spacing {spacing:.3g} {job.units}"
    return part, scanner, (f"{note}; the virtual scans cover the whole part, also where the job's scan has no points",)
