"""Whole jobs on example parts with few and many points: what comes of each, against the truth.

Usage: python -m tests.faults.sizes [--whole] [--write sizes.csv] [--against sizes-before.csv]

``--whole``: all parts with known and unknown pose, some minutes; else what the default and the slow tests run.
``--against``: says in which runs the outcome differs from that of an earlier file, and how much longer all runs take.
A run differs where a column other than the seconds does.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from damageest_benchmarks.troubles.classify import TrueState, judge

import damageest
from damageest.errors import InputError, StageError
from damageest.registry import Registry
from damageest.result import Result

PARTS = Path(__file__).parents[2] / "jobs/parts"
SIZES = (60, 200, 700, 2000, 5000, 9999, 10_000, 10_001, 30_000)
"""Points. Alignment compares poses on the first 1,500, 4,000 and 10,000, and much else changes at some number."""
TOLERANCES = (0.2, 0.5, 1.5)
"""mm, with a noise of 0.04 mm."""
DAMAGE: dict[str, dict[str, Any]] = {
    "block": {"tool": "sphere", "centre": [40, 30, 15], "radius": 12},  # a corner
    "ribbed_plate": {"tool": "box", "centre": [55, 30, 0], "size": [16, 14, 30], "rotation": [0, 0, 20]},  # an edge
    "blade": {"tool": "box", "centre": [0, 0, 80], "size": [60, 40, 20], "rotation": [10, 0, 0]},  # the tip
}


@dataclass(frozen=True)
class Case:
    """A job: a part of `PARTS` with its damage, the number of points, the tolerance in mm, and the stage `align`."""

    part: str
    points: int
    tolerance: float
    align: str

    @property
    def name(self) -> str:
        return f"{self.part} {self.points} {self.tolerance} {self.align}"


@dataclass(frozen=True)
class Row:
    """What came of a case. ``outcome``: right, said (wrong, but named or doubted), silent, refused in words, or fault;
    ``verdicts`` of the sites; ``volume`` accepted, in true ones; ``low`` and ``high``: its 95 % interval; ``iou``."""

    name: str
    outcome: str
    verdicts: str
    volume: str
    low: str
    high: str
    iou: str
    reason: str
    seconds: float

    @property
    def content(self) -> tuple[str, ...]:
        """What has to be the same where only the speed changes."""
        return self.outcome, self.verdicts, self.volume, self.low, self.high, self.iou, self.reason


def list_cases(whole: bool = False) -> list[Case]:
    """The default: one part at every second size and all tolerances, with known pose; with unknown pose at one
    tolerance; and the other parts at one size."""
    if whole:
        return [
            Case(part, points, tolerance, align)
            for part in DAMAGE for points in SIZES for tolerance in TOLERANCES for align in ("none", "register")
        ]  # fmt: skip
    known = [Case("block", points, tolerance, "none") for points in SIZES[::2] for tolerance in TOLERANCES]
    unknown = [Case("block", points, 0.5, "register") for points in SIZES if points != 10_000]
    others = [Case(part, 9999, 0.5, "register") for part in ("ribbed_plate", "blade")]
    return known + unknown + others


def list_cheap() -> list[Case]:
    """Those of the default that take a second at most, with known and with unknown pose."""
    known = [Case("block", points, tolerance, "none") for points, tolerance in ((60, 0.2), (700, 0.5), (700, 1.5))]
    return [*known, *(Case("block", points, 0.5, "register") for points in (60, 200, 700))]


def run_case(case: Case, registry: Registry) -> Row:
    """Runs a case in this process."""
    scan = {"use": "simulate", "points": case.points, "noise": 0.04, "damage": [DAMAGE[case.part]]}
    scan["pose"] = "identity" if case.align == "none" else "random"
    job = {"version": 1, "part": str(PARTS / f"{case.part}.stl"), "scan": scan, "tolerance": case.tolerance}
    start = time.perf_counter()
    try:
        found: Result | Exception = damageest.run(job | {"align": case.align, "report": "none"}, registry=registry)
    except Exception as error:  # a fault is a row as well
        found = error
    return _describe(case, found, round(time.perf_counter() - start, 2))


def _describe(case: Case, found: Result | Exception, seconds: float) -> Row:
    if isinstance(found, Exception):
        text = str(found).splitlines()[0]
        is_named = isinstance(found, InputError | StageError) and "unexpected" not in text
        shown = text if is_named else f"{type(found).__name__}: {text}"
        return Row(case.name, "refused" if is_named else "fault", "", "", "", "", "", shown, seconds)
    true = found.scan.truth
    assert true
    assert true.damage
    whole = true.damage.volume
    judgement = judge(found, TrueState(found.part, true.damage, true.T_part_scan, case.tolerance))
    low, high = (f"{value / whole:.9g}" for value in found.volume_95) if found.volume_95 else ("", "")
    unexpected = [text for text in found.failures if "unexpected" in text]
    return Row(
        case.name,
        "fault" if unexpected else judgement.outcome,
        " ".join(site.verdict.level for site in found.sites),
        f"{found.damage_volume / whole:.9g}",
        low,
        high,
        f"{judgement.iou:.6f}",
        "; ".join(unexpected) or judgement.reason,
        seconds,
    )


def read_rows(path: Path) -> list[Row]:
    """The rows of a file that `write_rows` wrote."""
    with path.open(newline="") as file:
        return [Row(**(row | {"seconds": float(row["seconds"])})) for row in csv.DictReader(file)]  # type: ignore[arg-type]


def write_rows(path: Path, rows: Sequence[Row]) -> None:
    """One line a case, with the names of the fields of `Row` above."""
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def compare_rows(before: Sequence[Row], after: Sequence[Row]) -> list[str]:
    """A line for each case whose outcome differs, and one on the time of the cases that both have."""
    earlier = {row.name: row for row in before}
    both = [row for row in after if row.name in earlier]
    lines = []
    for row in both:
        if row.content != earlier[row.name].content:
            lines.append(f"{row.name}: {' '.join(earlier[row.name].content)} -> {' '.join(row.content)}")
    seconds = sum(earlier[row.name].seconds for row in both), sum(row.seconds for row in both)
    lines.append(f"{len(lines)} of {len(both)} differ; {seconds[0]:.1f} s before, {seconds[1]:.1f} s now")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--whole", action="store_true")
    parser.add_argument("--write", type=Path)
    parser.add_argument("--against", type=Path)
    given = parser.parse_args()
    registry, rows = Registry.discover(), []
    for case in list_cases(given.whole):
        rows.append(run_case(case, registry))
        print(
            *rows[-1].content[:6],
            f"{rows[-1].seconds:.2f} s",
            rows[-1].name,
            rows[-1].reason[:80],
            sep="\t",
            flush=True,
        )
    if given.write:
        write_rows(given.write, rows)
    if given.against:
        print(*compare_rows(read_rows(given.against), rows), sep="\n")


if __name__ == "__main__":
    main()
