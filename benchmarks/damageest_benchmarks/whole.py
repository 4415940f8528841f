"""Whole runs as a user starts them: a process each, without a cache, with the page, beside other checkouts.

A run's processor seconds are divided by those of one pass of exact distances of a million points to the same part,
measured just before it, so that figures of two machines and of two hours can be compared.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

from damageest_evaluate.case import DamageCase, simulate_scan
from damageest_evaluate.meter import measure_libigl_seconds
from damageest_evaluate.tables import format_markdown
from damageest_evaluate.variants import VariationRequest

from damageest.artefacts import Part, Scan
from damageest.errors import InputError, suggest
from damageest.io.meshes import write_points, write_stl
from damageest.registry import Registry
from damageest_benchmarks.speed import make_speed_cases
from damageest_benchmarks.suite import make_cases

COMMON = ("block", "gear", "half_torus", "blade", "tube", "shaft", "keyed_shaft", "ribbed_plate", "lever", "coupling")
"""Parts of the ten common runs: a random damage, 150,000 points, unknown pose."""
LARGE = "two large losses"
"""The large run: a million points at a tolerance of five noises, known pose."""
WHOLE = (*COMMON, LARGE)
OWN = str(Path(sys.executable).with_name("damageest"))
"""The program of this environment."""


@dataclass(frozen=True)
class Run:
    """One run: processor seconds of the process and its children, those of the pass, and what came out."""

    kind: str
    program: str
    seconds: float
    libigl_seconds: float
    volume: float
    verdicts: tuple[str, ...]

    @property
    def passes(self) -> float:
        return self.seconds / self.libigl_seconds


def measure_whole(
    names: Sequence[str],
    programs: Sequence[str],
    repeat: int,
    timeout: float,
    tell: Callable[[Run], None] = lambda run: None,
) -> list[Run]:
    """``repeat`` runs of each case by each program, interleaved. Raises InputError for an unknown name."""
    cases = make_whole_cases(names or WHOLE)
    runs = []
    for case in cases:
        with tempfile.TemporaryDirectory(prefix="damageest-whole-") as place:
            part, scan = write_inputs(case, Path(place))
            for number in range(repeat):
                for k, program in enumerate(programs):
                    out = Path(place) / f"out-{k}-{number}"
                    libigl = 1e6 / len(scan.points) * measure_libigl_seconds(scan.points, part)
                    seconds = run_program(program, Path(place) / "job.yaml", out, timeout)
                    runs.append(Run(str(case.varied["kind"]), program, seconds, libigl, *_read_result(out)))
                    tell(runs[-1])
    return runs


def make_whole_cases(names: Sequence[str]) -> list[DamageCase]:
    """The cases of these names, of `WHOLE`."""
    registry = Registry.discover()
    common = make_cases(len(COMMON), 0, COMMON, "random", VariationRequest(), registry)
    known = {str(case.part): replace(case, varied={"kind": case.part}) for case in common}
    (large,) = make_speed_cases([LARGE], 0, (), registry)
    known[LARGE] = replace(large, scanner={**large.scanner, "noise": large.tolerance / 5})
    for name in names:
        if name not in known:
            raise InputError(
                f"--kinds: there is no '{name}'{suggest(name, list(known))}; there are: {', '.join(WHOLE)}"
            )
    return [known[name] for name in names]


def write_inputs(case: DamageCase, folder: Path) -> tuple[Part, Scan]:
    """Writes part, scan and job of a case into a folder. Returns the part, and the scan in the part's frame."""
    part = case.load_part()
    scan, _ = simulate_scan(case, part)
    assert scan.truth
    write_stl(folder / "part.stl", part)
    write_points(folder / "scan.ply", dict(zip("xyz", scan.points.T, strict=True)))
    job: dict[str, Any] = {"version": 1, "units": part.unit, "part": "part.stl", "scan": "scan.ply"}
    job["tolerance"] = case.tolerance
    if "align=none" in case.settings:
        job["align"] = "none"
    (folder / "job.yaml").write_text(json.dumps(job))
    return part, scan.move(scan.truth.T_part_scan)


def run_program(program: str, job: Path, out: Path, timeout: float) -> float:
    """Processor seconds of one run, start included; infinite where it took longer than ``timeout`` seconds."""
    words = [program, "run", str(job), "-o", str(out), "--no-cache"]
    before = _count_children()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    try:
        subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=timeout, env=environment)
    except subprocess.TimeoutExpired:
        return float("inf")
    return _count_children() - before


def _count_children() -> float:
    times = os.times()
    return times.children_user + times.children_system


def _read_result(out: Path) -> tuple[float, tuple[str, ...]]:
    """Volume and verdicts; nan where there is no result."""
    try:
        told = json.loads((out / "result.json").read_text())
    except FileNotFoundError:
        return float("nan"), ()
    return told["damage_volume"], tuple(site["verdict"]["level"] for site in told["sites"])


def make_whole_table(runs: Sequence[Run]) -> str:
    """A table in Markdown: a line a case, for each program its least passes, seconds, volume and verdicts."""
    programs = list(dict.fromkeys(run.program for run in runs))
    each = ("passes", "processor s", "volume", "verdicts")
    marks = [f" ({k + 1})" if len(programs) > 1 else "" for k in range(len(programs))]
    rows = [["run", *(f"{name}{mark}" for mark in marks for name in each)]]
    least: dict[str, list[float]] = {program: [] for program in programs}
    for kind in dict.fromkeys(run.kind for run in runs):
        row = [kind]
        for program in programs:
            own = [run for run in runs if (run.kind, run.program) == (kind, program)]
            best = min(own, key=lambda run: run.passes)
            if kind in COMMON:
                least[program].append(best.passes)
            verdicts = ", ".join(f"{best.verdicts.count(one)} {one}" for one in dict.fromkeys(best.verdicts))
            row += [f"{best.passes:.1f}", f"{min(run.seconds for run in own):.1f}", f"{best.volume:.2f}", verdicts]
        rows.append(row)
    if any(least.values()):
        last = ["median of the common runs"]
        for program in programs:
            last += [f"{median(least[program]):.1f}", "", "", ""]
        rows.append(last)
    return format_markdown(rows)
