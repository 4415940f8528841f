"""One run of a real part, compared with the crude difference in its pose and in others."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from damageest_evaluate.processes import Row

from damageest.errors import DamageestError, describe_error
from damageest_benchmarks.real.reference import measure_range, sample


@dataclass(frozen=True)
class RealPart:
    """A part of the folder of real data: files of the part and of the scan, both meshes in ``unit``; where they are
    from and under what licence. ``name``: of its folder."""

    name: str
    part: str
    scan: str
    unit: str
    source: str
    licence: str


PARTS: tuple[RealPart, ...] = (
    RealPart(
        "die", "part.ply", "scan.ply", "mm",
        "Damindarov/DMD on GitHub: a worn die for additive repair and the unworn one, both scanned and meshed",
        "none stated: for trying only",
    ),
)  # fmt: skip
"""What is tried. The data stays out of the repository; the folder has a folder for each part."""
TOLERANCES = ("0.15", "0.2", "0.3", "auto")
DRAWS = ("own", "7", "8", "9", "10")
"""Points of the scan: those of its mesh, or drawn from its triangles with this seed."""
DRAWN = 300_000


@dataclass(frozen=True)
class RealCase:
    """``folder``: of all real data. ``draw``: of `DRAWS`."""

    folder: str
    part: RealPart
    draw: str
    tolerance: str
    points: int = DRAWN
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        words = [self.part.name, self.draw, self.tolerance, self.points, self.source]
        return hashlib.sha256(json.dumps(words).encode()).hexdigest()[:16]

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        row = {"key": self.compute_key(), "part": self.part.name, "draw": self.draw, "tolerance": self.tolerance}
        return row | {"volume": 0.0, "low": 0.0, "high": 0.0, "verdict": "none", "codes": [], "reference": [],
                      "range": [], "held": False, "notes": 0, "sites": 0, "error": "", "seconds": 0.0}  # fmt: skip

    def run(self) -> Row:
        """As `run_real`."""
        return run_real(self)


def run_real(case: RealCase) -> Row:
    """Runs the program on the part and compares its largest site with the crude difference there."""
    import trimesh

    import damageest
    from damageest.artefacts import Scan
    from damageest.rules.notes import cap_notes, list_notes

    row, place = case.make_blank_row(), Path(case.folder) / case.part.name
    part, scan = (trimesh.load(place / name, process=False) for name in (case.part.part, case.part.scan))
    meshes = [(np.asarray(one.vertices, float), np.asarray(one.faces)) for one in (part, scan)]
    points = meshes[1][0] if case.draw == "own" else sample(*meshes[1], case.points, int(case.draw)).places
    settings = [f"tolerance={case.tolerance}", "allowance=none"]
    start = time.perf_counter()
    try:
        given = Scan(points, unit=case.part.unit)
        job = {"version": 1, "units": case.part.unit}
        result = damageest.run(job, part=meshes[0], scan=given, settings=settings)
    except DamageestError as error:
        return row | {"error": describe_error(error, 300), "seconds": time.perf_counter() - start}
    row |= {"seconds": time.perf_counter() - start, "sites": len(result.sites)}
    row["notes"] = len(cap_notes(list_notes(result)))
    if not result.sites:
        return row
    site = max(result.sites, key=lambda one: one.damage.volume)
    low, high = site.volume_95 or (0.0, 0.0)
    found = measure_range(
        sample(*meshes[0]), sample(*meshes[1], seed=1), result.pose.T_part_scan, result.tolerance,
        site.damage.vertices,
    )  # fmt: skip
    here, others = found[0][1], [loss for _, loss in found]
    return row | {
        "volume": site.damage.volume,
        "low": low,
        "high": min(high, 1e9),
        "verdict": site.verdict.level,
        "codes": sorted({reason.code for reason in site.verdict.reasons if reason.effect == "contradicts"}),
        "reference": [here.deeper, here.down],
        "range": [min(one.deeper for one in others), max(one.down for one in others)],
        "held": bool(low <= here.deeper <= high and low <= here.down <= high),
    }


def make_real_table(rows: Sequence[Mapping[str, Any]]) -> list[list[str]]:
    """Head and body of the table: a line for each run, and one for all."""
    head = [
        "part",
        "points",
        "tolerance",
        "site 1",
        "interval",
        "verdict",
        "deeper",
        "down",
        "over poses",
        "held",
        "notes",
    ]
    body = []
    for row in rows:
        reference, over = row["reference"] or [0.0, 0.0], row["range"] or [0.0, 0.0]
        interval = f"{row['low']:.0f} to {row['high']:.0f}"
        verdict = " ".join([row["verdict"], *row["codes"]])
        body.append(
            [row["part"], row["draw"], row["tolerance"], f"{row['volume']:.0f}", interval, row["error"] or verdict,
             f"{reference[0]:.0f}", f"{reference[1]:.0f}", f"{over[0]:.0f} to {over[1]:.0f}",
             "yes" if row["held"] else "no", str(row["notes"])]
        )  # fmt: skip
    likely = sum(row["verdict"] in ("likely", "proven") for row in rows)
    held = sum(row["held"] for row in rows)
    count = len(rows)
    return [head, *body, ["all", "", "", "", "", f"{likely} of {count}", "", "", "", f"{held} of {count}", ""]]


def list_sources() -> list[list[str]]:
    """Head and body of a table of the real parts, with where they are from."""
    return [["part", "from", "licence"], *([one.name, one.source, one.licence] for one in PARTS)]
