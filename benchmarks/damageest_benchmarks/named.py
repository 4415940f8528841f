"""Random damages, each enclosed with every background that a job may name, against the default's result."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from damageest_evaluate.damages import make_random_damage
from damageest_evaluate.processes import Row
from damageest_evaluate.scores import iou

from damageest.artefacts import Part, Scan, Solid, Truth
from damageest.errors import DamageestError, describe_error
from damageest.isolation import cpu_seconds
from damageest.stages.scan.simulate import Simulate
from damageest_benchmarks.parts import PARTS

BACKGROUNDS = ("offset", "minkowski", "bbox", "capsule", "cylinder", "build_volume")
POINTS = 60_000
NOISE = 0.00045
"""In diagonals of the part; the tolerance is four of them."""
FIRST_SEED = 900
LEAST = 0.97
"""Share of the default's IoU that counts as the same damage."""


@dataclass(frozen=True)
class NamedCase:
    """One random damage on one of the parts, in turn. ``source``: digest of the code."""

    seed: int
    backgrounds: tuple[str, ...] = BACKGROUNDS
    source: str = ""
    varied: Mapping[str, float | str] = field(default_factory=dict)

    @property
    def part_name(self) -> str:
        return list(PARTS)[self.seed % len(PARTS)]

    def compute_key(self) -> str:
        """The case's identifier in a file of rows."""
        text = json.dumps([self.seed, self.backgrounds, self.source])
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def make_blank_row(self) -> Row:
        """The row of the case without a result."""
        row: Row = {"key": self.compute_key(), "seed": self.seed, "part": self.part_name, "kinds": []}
        return row | {"default_iou": 0.0, "default_seconds": 0.0, "cells": {}, "error": ""}

    def run(self) -> Row:
        """The scan is in the part's frame. What is computed up to the sites is shared: a cell's ``seconds`` are the
        processor time of what differs."""
        from damageest import MemoryCache

        part = PARTS[self.part_name]()
        drawn = make_random_damage(part, FIRST_SEED + self.seed)
        noise = NOISE * part.diagonal
        scanner: Any = {"points": POINTS, "noise": noise, "pose": "identity", "damage": drawn.tools, "seed": self.seed}
        scan = Simulate.model_validate(scanner).run(part.unit, part)
        assert isinstance(scan.truth, Truth)
        assert scan.truth.damage is not None
        seen, cache, truth = Scan(scan.points, unit=scan.unit), MemoryCache(), scan.truth.damage
        job = {"version": 1, "units": part.unit, "tolerance": 4 * noise, "align": "none", "adapt": "none"}
        default = _run_cell(job, part, seen, truth, cache)
        cells = {
            name: _run_cell({**job, "method": "surface", "background": made}, part, seen, truth, cache)
            for name, made in ((name, make_background(name, part)) for name in self.backgrounds)
        }
        row = self.make_blank_row() | {"kinds": list(drawn.kinds), "cells": cells}
        return row | {"default_iou": default["iou"], "default_seconds": default["seconds"]}


def make_background(name: str, part: Part) -> dict[str, Any]:
    """The stage `background` of a job; a build volume is half as large again as the part, about its middle."""
    if name != "build_volume":
        return {"use": name}
    low, high = part.bounds
    size = 1.5 * (high - low) + 0.05 * part.diagonal
    return {"use": name, "size": size.tolist(), "corner": ((low + high - size) / 2).tolist()}


def _run_cell(job: Mapping[str, Any], part: Part, scan: Scan, truth: Solid, cache: Any) -> dict[str, Any]:
    import damageest

    start = cpu_seconds()
    try:
        result = damageest.run(
            dict(job), part=part, scan=scan, settings=["report=none", "accept=all"], cache=cache, output=False
        )
    except DamageestError as error:
        return {"iou": 0.0, "volume": 0.0, "refused": describe_error(error), "seconds": cpu_seconds() - start}
    found = [site.damage for site in result.sites]
    return {
        "iou": iou(found, [truth]), "volume": sum(one.volume for one in found) / truth.volume,
        "refused": " ".join(" ".join(result.failures).split()), "seconds": cpu_seconds() - start,
    }  # fmt: skip


def judge_cell(row: Row, name: str) -> str:
    """`right`: the default's damage; `refused`: some sites are, and the remedy's run finds them; else `wrong`."""
    cell = row["cells"][name]
    if cell["iou"] >= LEAST * row["default_iou"]:
        return "right"
    return "refused" if "method: implicit" in cell["refused"] and row["default_iou"] > LEAST**2 else "wrong"


def describe_row(row: Row) -> str:
    """A draw in a line."""
    if row["error"]:
        return f"{row['seed']} {row['part']}: {row['error']}"
    cells = ", ".join(
        f"{name} {cell['iou']:.3f}" + ("" if (said := judge_cell(row, name)) == "right" else f" {said.upper()}")
        for name, cell in row["cells"].items()
    )
    return f"{row['seed']} {row['part']} ({', '.join(row['kinds'])}): default {row['default_iou']:.3f}; {cells}"


def make_named_table(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body of the table: a line for each background. Its time is that of `offset` in the same draw."""
    head = ["background", "draws", "right", "refused with a remedy that works", "wrong", "median IoU", "time"]
    done = [row for row in rows if row["cells"]]
    return [head, *(_make_line(name, done) for name in (done[0]["cells"] if done else ()))]


def _make_line(name: str, rows: Sequence[Row]) -> list[str]:
    said = [judge_cell(row, name) for row in rows]
    ratios = [
        row["cells"][name]["seconds"] / row["cells"]["offset"]["seconds"] for row in rows if "offset" in row["cells"]
    ]
    return [
        name, str(len(rows)), *(str(said.count(word)) for word in ("right", "refused", "wrong")),
        f"{np.median([row['cells'][name]['iou'] for row in rows]):.4f}", f"{np.median(ratios):.2f}" if ratios else "",
    ]  # fmt: skip
