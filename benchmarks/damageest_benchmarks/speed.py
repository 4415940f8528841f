"""Cases that show where the time goes: each is of another kind, with damage and scan given."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from statistics import median
from typing import Any, NamedTuple

from damageest_evaluate.case import DamageCase
from damageest_evaluate.job import fingerprint_code
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import format_markdown

from damageest.errors import InputError, suggest
from damageest.registry import Registry
from damageest_benchmarks.built_in import BuiltInCase
from damageest_benchmarks.parts import PARTS, REFINED

Tools = Sequence[Mapping[str, Any]]


class Kind(NamedTuple):
    """``part``: name of a built-in part; ``tools``: what takes its damage off; ``points`` of the scan; ``fineness``:
    the part's diagonal in tolerances, the noise is a quarter of a tolerance; ``known``: the pose is given."""

    part: str
    tools: Tools
    points: int
    fineness: float
    known: bool = True


CHIP = [{"tool": "sphere", "centre": [38, 0, 9], "radius": 3.0}]
TWO_LOSSES: Tools = [
    {"tool": "plane", "point": [31, 0, 9], "normal": [1, 0.2, 0.6]},
    {"tool": "sphere", "centre": [-34, -24, 14], "radius": 15},
]
EIGHTH = [{"tool": "plane", "point": [27, 0, 0], "normal": [1, 0.1, 0.2]}]
CYLINDER = [{"tool": "blob", "centre": [20, 0, 12], "radius": 8, "seed": 3}]
FIXED = [{"tool": "sphere", "centre": [-25, 25, 15], "radius": 6}]
MANY: Tools = [
    {"tool": "sphere", "centre": [-52 + 34 * (k // 3), -33 + 33 * (k % 3), 0], "radius": 5 + 0.2 * k} for k in range(12)
]

TOOTH = [{"tool": "sphere", "centre": [40, 3, 4], "radius": 3.0}]
ON_BLADE: Tools = [
    {"tool": "sphere", "centre": [0, -1, 40], "radius": 4},
    {"tool": "sphere", "centre": [12, 4, 60], "radius": 4},
    {"tool": "sphere", "centre": [-10, -3, 20], "radius": 4},
]
ON_PLATE: Tools = [
    {"tool": "plane", "point": [45, 25, 0], "normal": [1, 1, 0.2]},
    {"tool": "sphere", "centre": [-30, -20, 8], "radius": 16},
]

KINDS: Mapping[str, Kind] = {
    "small chip": Kind("gear", CHIP, 1_000_000, 500),
    "small scan": Kind("gear", CHIP, 20_000, 500),
    "two large losses": Kind("block", TWO_LOSSES, 1_000_000, 700),
    "an eighth lost": Kind("block", EIGHTH, 1_000_000, 500, known=False),
    "an eighth lost, 150,000 points": Kind("block", EIGHTH, 150_000, 500, known=False),
    "fine tolerance": Kind("block", FIXED, 1_000_000, 3000),
    "twelve sites": Kind("ribbed_plate", MANY, 150_000, 500),
    "featureless": Kind("cylinder", CYLINDER, 150_000, 500, known=False),
    "a tooth": Kind("gear", TOOTH, 150_000, 500, known=False),
    "three sites, 242,752 triangles": Kind("fine_blade", ON_BLADE, 150_000, 500, known=False),
    "the same, 971,008 triangles": Kind("finest_blade", ON_BLADE, 150_000, 500, known=False),
    "two large losses, 5,224 triangles, fine": Kind("fine_plate", ON_PLATE, 1_000_000, 2000),
    "dense scan": Kind("gear", CHIP, 10_000_000, 500),
}
MOST_STAGES = 4
"""Stages that a line of the table lists."""
USUAL = tuple(name for name in KINDS if name != "dense scan")


def make_speed_cases(
    names: Sequence[str], points: int, settings: Sequence[str], registry: Registry
) -> list[DamageCase]:
    """The cases with these names, of `KINDS`; ``points``: of each scan, 0 for the case's own number.

    Raises InputError for an unknown name.
    """
    cases, code = [], fingerprint_code(registry)
    for name in names:
        if name not in KINDS:
            raise InputError(
                f"--kinds: there is no '{name}'{suggest(name, list(KINDS))}; there are: {', '.join(KINDS)}"
            )
        cases.append(replace(_make_case(name, points, settings), source=code))
    return cases


def _make_case(name: str, points: int, settings: Sequence[str]) -> DamageCase:
    kind = KINDS[name]
    tolerance = float(f"{(PARTS | REFINED)[kind.part]().diagonal / kind.fineness:.3g}")
    pose = "identity" if kind.known else "random"
    return BuiltInCase(
        part=kind.part,
        seed=1,
        first="",
        tolerance=tolerance,
        tools=kind.tools,
        scanner={"points": points or kind.points, "noise": tolerance / 4, "density": 0.4, "pose": pose},
        settings=[f"tolerance={tolerance}", *(["align=none"] if kind.known else []), *settings],
        varied={"kind": name},
    )


def make_speed_table(rows: Sequence[Sequence[Row]]) -> str:
    """A table in Markdown with a line for each case, from the rows of its runs. Times are medians."""
    head = [
        "kind",
        "points",
        "IoU",
        "surface error",
        "processor s",
        "s",
        "libigl s",
        "a million",
        "x libigl",
        "peak MB",
        "stages, s",
    ]
    return format_markdown([head, *(_make_line(runs) for runs in rows)])


def _make_line(runs: Sequence[Row]) -> list[str]:
    row = runs[0]
    name, points = str(row["varied"]["kind"]), f"{row['points']}"
    if row["error"]:
        return [name, points, row["error"], *[""] * 8]
    seconds, processor, libigl = (
        median(run[what] for run in runs) for what in ("seconds", "cpu_seconds", "libigl_seconds")
    )
    stages = {stage: median(run["stage_seconds"].get(stage, 0.0) for run in runs) for stage in row["stage_seconds"]}
    longest = sorted(stages.items(), key=lambda item: -item[1])[:MOST_STAGES]
    rest = seconds - sum(stages.values())
    return [
        name,
        points,
        f"{row['iou']:.4f}",
        f"{row['surface_error']:.3f}" if row["surface_error"] is not None else "",
        f"{processor:.1f}",
        f"{seconds:.1f}",
        f"{libigl:.2f}",
        f"{1e6 * libigl / float(points):.2f}",
        f"{processor / libigl:.1f}",
        f"{max(run['megabytes'] for run in runs):.0f}",
        ", ".join(f"{stage} {took:.1f}" for stage, took in longest) + f", checks {rest:.1f}",
    ]
