"""One case of an evaluation, from the random damage to its score, as a row of values that JSON can hold."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Part, Scan, Solid
from damageest.errors import DamageestError, StageError, describe_error
from damageest.isolation import cpu_seconds
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate
from damageest_evaluate.damages import make_random_damage
from damageest_evaluate.memory import PeakMemory
from damageest_evaluate.meter import Meter, measure_libigl_seconds, measure_start_seconds
from damageest_evaluate.scores import measure_depth, score
from damageest_evaluate.sized import make_sized_damage

TIMES = (
    "seconds",
    "stage_seconds",
    "cpu_seconds",
    "start_seconds",
    "libigl_seconds",
    "megabytes",
    "stage_megabytes",
)
"""Fields of a row that differ from run to run. All other fields are determined by the case."""


@dataclass(frozen=True)
class DamageCase:
    """The inputs of one case. Equal cases give equal scans.

    ``part``: the display name of the part in ``file`` (.npz). ``first``: kind of the first
    damage. ``size``: depth of the damage in the part's unit; 0: no damage; None: random. ``tools``: damage that is
    given, as in option damage of `simulate`; then nothing is random. ``scanner``: options of
    `simulate` other than damage and seed. ``job``: path of a job file, empty for the defaults; ``settings`` are applied
    to it. ``source``: digest of both files and of the code. ``tolerance``: the tolerance that the run is expected to
    use. ``varied``: the values under which the case is listed in the tables.
    """

    part: str
    seed: int
    first: str
    tolerance: float
    size: float | None = None
    tools: Sequence[Mapping[str, Any]] = ()
    scanner: Mapping[str, Any] = field(default_factory=dict)
    settings: Sequence[str] = ()
    varied: Mapping[str, float | str] = field(default_factory=dict)
    source: str = ""
    job: str = ""
    file: str = ""

    def compute_key(self) -> str:
        """The case's identifier in a file of rows. It does not depend on paths or on what the other cases vary."""
        values = {name: value for name, value in vars(self).items() if name not in ("job", "file", "varied")}
        return hashlib.sha256(json.dumps(values).encode()).hexdigest()[:16]

    def make_blank_row(self) -> dict[str, Any]:
        """The row of a case that has no result yet."""
        row: dict[str, Any] = {"key": self.compute_key(), "part": self.part, "seed": self.seed, "size": self.size}
        row |= {"varied": dict(self.varied), "noise": self.scanner["noise"], "points": self.scanner["points"]}
        row |= {"tolerance": self.tolerance, "kinds": [], "share": 0.0, "depth": 0.0, "error": "", "skipped": False}
        row |= {"iou": 0.0, "found": 0, "missed": int(self.size != 0), "false_sites": 0, "sites": 0, "flagged": False}
        return row | {"methods": [], "failures": [], "reasons": [], "seconds": 0.0}

    def load_part(self) -> Part:
        """The part, read from the file."""
        data = np.load(self.file)
        return Part(
            data["vertices"],
            data["faces"],
            unit=str(data["unit"]),
            faces_brep=data.get("faces_brep"),
            tessellation_error=float(data["error"]),
        )

    def run(self) -> dict[str, Any]:
        """As `run_case`."""
        return run_case(self)


def save_part(part: Part, path: Path) -> None:
    """Writes the fields of a part that the stages use, as .npz."""
    brep: dict[str, Any] = {} if part.faces_brep is None else {"faces_brep": part.faces_brep}
    np.savez(path, vertices=part.vertices, faces=part.faces, unit=part.unit, error=part.tessellation_error, **brep)


def simulate_scan(case: DamageCase, part: Part) -> tuple[Scan, tuple[str, ...]]:
    """The simulated scan with its truth, and the damages' kinds. Raises LookupError if no damage fits the part."""
    tools: tuple[Any, ...] = tuple(case.tools)
    kinds: tuple[str, ...] = ()
    if case.size != 0 and not tools:
        drawn = make_random_damage(part, case.seed, (case.first,)) if case.size is None else None
        drawn = drawn or make_sized_damage(part, case.seed, float(case.size or 0), case.first)
        tools, kinds = drawn.tools, drawn.kinds
    scanner = Simulate.model_validate({**case.scanner, "damage": tools, "seed": case.seed})
    return scanner.run(part.unit, part), kinds


def run_case(case: DamageCase) -> dict[str, Any]:
    """Runs a case and gives its row: the score, and the checks and costs that the result reports.

    If the run fails, ``error`` holds the message. If no damage fits the part, ``skipped`` is True.
    """
    start_seconds = measure_start_seconds()
    with PeakMemory() as memory:
        return _run_measured(case, Meter(memory), start_seconds)


def _run_measured(case: DamageCase, meter: Meter, start_seconds: float) -> dict[str, Any]:
    import damageest

    part, row = case.load_part(), case.make_blank_row()
    try:
        scan, kinds = simulate_scan(case, part)
    except (LookupError, DamageestError) as error:
        return row | {"error": describe_error(error), "skipped": True, "missed": 0}
    truth = scan.truth
    assert truth is not None
    damage = truth.damage
    row |= {"kinds": list(kinds), "points": len(scan.points)}
    row |= {"share": damage.volume / part.volume, "depth": measure_depth(damage, part)} if damage else {}
    result = None
    registry = Registry.discover([meter])
    blind = Scan(scan.points, unit=scan.unit)  # without the truth
    start, cpu_start = time.perf_counter(), cpu_seconds()
    try:
        # the damage is scored, and a cut-back would enlarge it
        settings = ["allowance=none", *case.settings]
        result = damageest.run(case.job or {"version": 1}, part=part, scan=blind, settings=settings, registry=registry)
    except DamageestError as error:
        # a refusal by a stage counts as flagged; an invalid job or input would be an error of the evaluation itself
        row |= {"error": describe_error(error), "flagged": isinstance(error, StageError)}
    row |= {"seconds": time.perf_counter() - start, "cpu_seconds": cpu_seconds() - cpu_start}
    row["start_seconds"] = start_seconds
    # read before scoring, which needs memory of its own
    row |= {"megabytes": meter.measure_megabytes(), "stage_megabytes": meter.stage_megabytes}
    row["libigl_seconds"] = measure_libigl_seconds(scan.move(truth.T_part_scan).points, part)
    row |= _score_result(result, part, scan) if result else {"missed": score(part, [], damage, case.tolerance).missed}
    return {name: None if isinstance(v, float) and math.isnan(v) else v for name, v in row.items()}


def _score_result(result: Result, part: Part, scan: Scan) -> dict[str, Any]:
    """The fields of a row that come from the result."""
    truth = scan.truth
    assert truth is not None
    solids: list[Solid] = [site.damage for site in result.sites]
    scores = score(part, solids, truth.damage, result.tolerance, result.pose.T_part_scan, truth.T_part_scan)
    stages: dict[str, float] = {}
    for record in result.stages:
        stages[record.stage] = round(stages.get(record.stage, 0.0) + record.seconds, 3)
    consistent = all(site.evidence.consistent for site in result.sites)
    return vars(scores) | {
        "tolerance": result.tolerance,
        "sites": len(result.sites),
        "methods": sorted({site.method for site in result.sites}),
        "flagged": not consistent or result.status != "ok",
        "failures": [text.replace("\n", " ") for text in result.failures],
        "reasons": [reason.code for site in result.sites for reason in site.verdict.reasons],
        "stage_seconds": stages,
    }
