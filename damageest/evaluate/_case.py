"""One case, from the random damage to its score, as a row that JSON can hold; ``python -m`` runs one in its process."""

from __future__ import annotations

import hashlib
import json
import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from damageest.artefacts import Part, Scan, Solid
from damageest.errors import DamageestError, StageError
from damageest.evaluate._meter import Meter, libigl_seconds, started
from damageest.evaluate._run import MARK
from damageest.evaluate.damages import random_damage
from damageest.evaluate.parts import PARTS
from damageest.evaluate.scores import depth, score
from damageest.evaluate.sized import sized_damage
from damageest.registry import Registry
from damageest.result import Result
from damageest.stages.scan.simulate import Simulate

TIMES = (
    "seconds",
    "stage_seconds",
    "cpu_seconds",
    "start_seconds",
    "libigl_seconds",
    "megabytes",
    "stage_megabytes",
)
"""What of a row differs from run to run; all else follows from the case."""


@dataclass(frozen=True)
class Case:
    """What makes a case; equal cases give equal scans.

    ``part`` is the name of a built-in one, or what the one in ``file`` (.npz) is called. ``first``: kind of the first
    loss. ``size``: depth of the damage; 0: none; None: any. ``scanner``: options of `simulate` beside damage and seed.
    ``job``: a job file, else the defaults, to which ``settings`` apply; ``source`` stands for the contents of both
    files and for the code that computes. ``tolerance``: the one to expect. ``varied``: what this case stands for in the
    tables.
    """

    part: str
    seed: int
    first: str
    tolerance: float
    size: float | None = None
    scanner: Mapping[str, Any] = field(default_factory=dict)
    settings: Sequence[str] = ()
    varied: Mapping[str, float | str] = field(default_factory=dict)
    source: str = ""
    job: str = ""
    file: str = ""

    def key(self) -> str:
        """Names the case among the rows of a file, wherever its part and job lie and whatever else is varied."""
        values = {name: value for name, value in vars(self).items() if name not in ("job", "file", "varied")}
        return hashlib.sha256(json.dumps(values).encode()).hexdigest()[:16]


def blank(case: Case) -> dict[str, Any]:
    """The row of a case that has no result."""
    row: dict[str, Any] = {"key": case.key(), "part": case.part, "seed": case.seed, "size": case.size}
    row |= {"varied": dict(case.varied), "noise": case.scanner["noise"], "points": case.scanner["points"]}
    row |= {"tolerance": case.tolerance, "kinds": [], "share": 0.0, "depth": 0.0, "error": "", "skipped": False}
    row |= {"iou": 0.0, "found": 0, "missed": int(case.size != 0), "invented": 0, "sites": 0, "flagged": False}
    return row | {"methods": [], "failures": [], "reasons": [], "seconds": 0.0}


def save_part(part: Part, path: Path) -> None:
    """Writes what the stages use of a part."""
    brep: dict[str, Any] = {} if part.faces_brep is None else {"faces_brep": part.faces_brep}
    np.savez(path, vertices=part.vertices, faces=part.faces, unit=part.unit, error=part.tessellation_error, **brep)


def part_of(case: Case) -> Part:
    if not case.file:
        return PARTS[case.part]()
    data = np.load(case.file)
    return Part(
        data["vertices"],
        data["faces"],
        unit=str(data["unit"]),
        faces_brep=data.get("faces_brep"),
        tessellation_error=float(data["error"]),
    )


def scanned(case: Case, part: Part) -> tuple[Scan, tuple[str, ...]]:
    """The scan with the truth, and the kinds of the damage. Raises LookupError where no damage fits the part."""
    tools: tuple[Any, ...] = ()
    kinds: tuple[str, ...] = ()
    if case.size != 0:
        made = random_damage(part, case.seed, (case.first,)) if case.size is None else None
        made = made or sized_damage(part, case.seed, float(case.size or 0), case.first)
        tools, kinds = made.tools, made.kinds
    scanner = Simulate.model_validate({**case.scanner, "damage": tools, "seed": case.seed})
    return scanner.run(part.unit, part), kinds


def run_case(case: Case) -> dict[str, Any]:
    """The row of a case: its score and what the result said of itself; ``error`` where there is no result, and
    ``skipped`` where there is no case."""
    import damageest

    start_seconds = started()
    part, row = part_of(case), blank(case)
    try:
        scan, kinds = scanned(case, part)
    except (LookupError, DamageestError) as error:
        return row | {"error": _one_line(error), "skipped": True, "missed": 0}
    truth = scan.truth
    assert truth is not None
    lost = truth.damage
    row |= {"kinds": list(kinds), "points": len(scan.points)}
    row |= {"share": lost.volume / part.volume, "depth": depth(lost, part)} if lost else {}
    found, meter = None, Meter()
    registry = Registry.discover([meter])
    alone = Scan(scan.points, unit=scan.unit)  # without the truth
    start, busy = time.perf_counter(), time.process_time()
    try:
        # what is scored is the damage, which a cut-back would enlarge
        settings = ["allowance=none", *case.settings]
        found = damageest.run(case.job or {"version": 1}, part=part, scan=alone, settings=settings, registry=registry)
    except DamageestError as error:
        # a stage that refuses owns up to it; a job or an input at fault would be the evaluation's own mistake
        row |= {"error": _one_line(error), "flagged": isinstance(error, StageError)}
    row |= {"seconds": time.perf_counter() - start, "cpu_seconds": time.process_time() - busy}
    row["start_seconds"] = start_seconds
    row |= {"megabytes": meter.megabytes, "stage_megabytes": meter.stage_megabytes}  # before the scoring
    row["libigl_seconds"] = libigl_seconds(scan.move(truth.T_part_scan).points, part)
    row |= _scored(found, part, scan) if found else {"missed": score(part, [], lost, case.tolerance).missed}
    return {name: None if isinstance(v, float) and math.isnan(v) else v for name, v in row.items()}


def _scored(found: Result, part: Part, scan: Scan) -> dict[str, Any]:
    truth = scan.truth
    assert truth is not None
    solids: list[Solid] = [site.damage for site in found.sites]
    marks = score(part, solids, truth.damage, found.tolerance, found.pose.T_part_scan, truth.T_part_scan)
    stages: dict[str, float] = {}
    for record in found.stages:
        stages[record.stage] = round(stages.get(record.stage, 0.0) + record.seconds, 3)
    consistent = all(site.evidence.consistent for site in found.sites)
    return vars(marks) | {
        "tolerance": found.tolerance,
        "sites": len(found.sites),
        "methods": sorted({site.method for site in found.sites}),
        "flagged": not consistent or found.status != "ok",
        "failures": [text.replace("\n", " ") for text in found.failures],
        "reasons": [reason for site in found.sites for reason in site.evidence.reasons],
        "stage_seconds": stages,
    }


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


if __name__ == "__main__":
    print(MARK + json.dumps(run_case(Case(**json.loads(sys.argv[1])))), flush=True)
