"""How well damage of a given size will be found on the user's own part, with a scanner like theirs."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from damageest.artefacts import Part
from damageest.checks.scan_quality import choose_tolerance
from damageest.errors import InputError
from damageest.evaluate._case import Case, save_part
from damageest.evaluate._vary import Base, Variant, Wanted, variants
from damageest.evaluate.damages import KINDS
from damageest.evaluate.sized import SIZED
from damageest.geometry.noise import measure_noise_and_spacing
from damageest.io.files import file_sha256
from damageest.job import Job, load
from damageest.pipeline.cache import digest
from damageest.pipeline.engine import Engine, start
from damageest.registry import Registry
from damageest.stages.align import Align
from damageest.stages.part import ReadPart
from damageest.stages.scan import ReadScan
from damageest.stages.scan.simulate import Simulate

SIZES = (0, 2, 4, 8, 16)
"""Depths tried where none are asked for, in tolerances; 0: a sound part."""
DEEPEST = 0.1
"""Of the part's diagonal: default depths stay below."""


@dataclass(frozen=True)
class Study:
    """The cases, and in ``notes`` what part and scanner they stand for."""

    cases: list[Case]
    unit: str
    notes: tuple[str, ...]


def study(path: Path, wanted: Wanted, seeds: int, registry: Registry, place: Path) -> Study:
    """The cases for a job, its part saved in the folder ``place``. Raises JobError or InputError where the job, its
    files, or what is to be varied is at fault."""
    job = load(path, registry, wanted.settings)
    part, scanner, notes = _read(job, registry)
    tolerance = job.tolerance or _automatic(part, scanner)
    if not wanted.size:
        fitting = [size for size in SIZES if size * tolerance <= DEEPEST * part.diagonal]
        wanted = replace(wanted, size=",".join(f"{size}x" for size in fitting))
    uses = {contract.stage: item.name for contract, item in job.implementations.items()}
    base = Base(job.units, scanner, tolerance, job.tolerance is None, False, uses)
    ways = variants(wanted, base)
    for way in ways:
        checked(path, way, part, registry)
    save_part(part, place / "part.npz")
    source = digest(code(registry), file_sha256(path), part.vertices, part.faces)
    cases = [_case(way, seed, job, path, source, place) for seed in range(seeds) for way in ways]
    told = (
        f"{scanner['points']} points, noise {scanner['noise']:.4g} {job.units}, tolerance {tolerance:.4g} {job.units}"
    )
    return Study(cases, job.units, (f"{job.name}: part {part.diagonal:.4g} {job.units} across, {told}", *notes))


def code(registry: Registry) -> str:
    """Stands for the code of damageest and its plugins: rows that other code gave are not gone on from."""
    return digest(*(provider.fingerprint for provider in registry.providers))


def checked(job: Path | dict[str, Any], way: Variant, part: Part, registry: Registry) -> None:
    """Raises JobError where the variant makes no valid job, before hours of work."""
    scan = "scan=" + json.dumps({"use": "simulate", **way.scanner})
    load(job, registry, [*way.settings, scan], {ReadPart: part})


def _case(way: Variant, seed: int, job: Job, path: Path, source: str, place: Path) -> Case:
    kinds = SIZED if way.size else tuple(KINDS)
    return Case(
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
        file=str(place / "part.npz"),
    )


def _automatic(part: Part, scanner: dict[str, Any]) -> float:
    from damageest.artefacts import Scan

    empty = Scan(part.vertices[:1], noise=scanner["noise"])
    return choose_tolerance(None, empty, part)[0]


def _read(job: Job, registry: Registry) -> tuple[Part, dict[str, Any], tuple[str, ...]]:
    """The part, the options of a virtual scanner like the job's, and what to know about them."""
    engine = Engine(job, registry)
    state = engine.call(ReadPart, start(job).job)
    part = state.part
    own = job.stages[ReadScan]
    if isinstance(own, Simulate):
        scanner = own.model_dump(mode="json", exclude={"use", "damage", "seed"})
        return part, {**scanner, "noise": 0.0005 * part.diagonal if own.noise is None else own.noise}, ()
    points = engine.call(ReadScan, state).scan.points
    noise, spacing = measure_noise_and_spacing(points)
    if not spacing:
        raise InputError(f"scan: {len(points)} points are too few to measure its noise and spacing")
    known = job.implementations[Align].name != "register"
    scanner = {"points": len(points), "noise": float(f"{noise:.4g}"), "pose": "identity" if known else "random"}
    # as many points as lie so far apart on this part: the job's scan may show half of it, or a fixture as well
    tried = Simulate.model_validate(scanner).run(part.unit, part).points
    scanner["points"] = round(len(points) * (measure_noise_and_spacing(tried)[1] / spacing) ** 2)
    note = f"the scan's points measure a noise of {noise:.3g} and lie {spacing:.3g} {job.units} apart"
    return part, scanner, (f"{note}; what it does not show of the part is taken as seen",)
