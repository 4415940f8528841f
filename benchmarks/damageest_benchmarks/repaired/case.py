"""One repaired workpiece, inspected once for each kind of fault."""

from __future__ import annotations

import hashlib
import json
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row

from damageest.artefacts import Floats, Part, Scan
from damageest.errors import DamageestError, describe_error
from damageest.geometry.solids import to_solid
from damageest_benchmarks.repaired.scenes import KINDS, TOLERANCE, Draw, Repaired, make_workpiece, scan

DRAWS = 10


@dataclass(frozen=True)
class RepairedCase:
    """A workpiece by its number. ``kinds``: which inspections of it."""

    seed: int
    kinds: tuple[str, ...] = tuple(KINDS)
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        told = json.dumps([self.seed, self.kinds, self.source])
        return hashlib.sha256(told.encode()).hexdigest()[:16]

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        return {"key": self.compute_key(), "seed": self.seed, "inspections": [], "error": "", "seconds": 0.0}

    def run(self) -> Row:
        """As `run_repaired`."""
        return run_repaired(self)


def run_repaired(case: RepairedCase) -> Row:
    """Runs a workpiece before its repair, and inspects it after each."""
    import damageest
    from damageest.inspection.aim import read_aim

    row, start, work = case.make_blank_row(), time.perf_counter(), make_workpiece(case.seed)
    solid = to_solid(work.body, np.zeros(3))
    assert solid is not None
    rng = np.random.default_rng([703, case.seed])
    before = Scan(scan(work.lose(), 0.6, 0.02, rng), unit="mm")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        job: dict[str, Any] = {
            "version": 1, "units": "mm", "tolerance": TOLERANCE, "report": "none", "export": {"format": "ply"},
            "allowance": {"use": "milling", "outer": 1.0, "overlap": 0.5},
        }  # fmt: skip
        try:
            damageest.run(job, part=Part(solid.vertices, solid.faces, unit="mm"), scan=before, output=folder / "out")
            aim = read_aim(folder / "out", "milled")
        except DamageestError as error:
            return row | {"error": describe_error(error, 300), "seconds": time.perf_counter() - start}
        middles = {number: body.bounds.mean(axis=0) for number, body in aim.deposits.items()}
        near = {n: int(np.linalg.norm(work.places - at, axis=1).argmin()) for n, at in middles.items()}
        for kind in case.kinds:
            draw = Draw(work, 100 * case.seed + list(KINDS).index(kind))
            row["inspections"].append(_inspect(kind, KINDS[kind](draw), aim, near, folder))
    return row | {"seconds": time.perf_counter() - start}


def _inspect(kind: str, repaired: Repaired, aim: Any, near: Mapping[int, int], folder: Path) -> dict[str, Any]:
    from damageest.inspection.compare import Question, inspect_step

    np.save(folder / "after.npy", _move(repaired.points) if kind == "perfect, moved" else repaired.points)
    told: dict[str, Any] = {"kind": kind, "perfect": repaired.is_perfect, "error": "", "whole": "", "sites": [],
                            "signed_wrongly": False, "findings": []}  # fmt: skip
    try:
        found = inspect_step(aim, folder / "after.npy", Question())
    except DamageestError as error:
        return told | {"error": describe_error(error, 300)}
    sites = [[near[one.site], one.outcome, one.why, one.seen, one.shows] for one in found.verdicts]
    bad = {*repaired.wrong, *repaired.blind}
    wrongly = any(outcome == "met" and site in bad for site, outcome, *_ in sites)
    wrongly |= found.whole.outcome == "met" and not repaired.is_perfect
    findings = [[one.kind, list(one.sites), one.volume, one.level] for one in found.findings]
    return told | {"whole": found.whole.outcome, "sites": sites, "signed_wrongly": wrongly, "findings": findings}


def _move(points: Floats) -> Floats:
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_euler("xyz", [35, -50, 110], degrees=True).as_matrix()
    return np.asarray(points @ turn.T + (120.0, -40.0, 15.0))


def make_repaired_cases(draws: int, source: str) -> list[RepairedCase]:
    """The first workpieces of the family."""
    return [RepairedCase(seed, source=source) for seed in range(draws)]


def make_repaired_table(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Head and body of the table: a line for each kind, and one for all."""
    done = [one for row in rows for one in row["inspections"]]
    groups = {kind: [one for one in done if one["kind"] == kind] for kind in KINDS} | {"all": done}
    body = []
    for name, group in groups.items():
        outcomes = [sum(one["whole"] == word for one in group) for word in ("met", "not met", "not shown")]
        counts = [*outcomes, sum(bool(one["error"]) for one in group), sum(one["signed_wrongly"] for one in group)]
        body.append([name, str(len(group)), *map(str, counts)])
    head = ["after the repair", "inspections", "met", "not met", "not shown", "refused", "signed as met, wrongly"]
    return [head, *(line for line in body if line[1] != "0")]
