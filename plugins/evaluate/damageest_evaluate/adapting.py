"""Measures the stage `adapt` on deformed parts with known loss and without, and on worn parts, straight and bent.

``python -m damageest_evaluate.adapting [--only NAME] [--set SETTING]`` prints a table, and the rows as JSON.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import damageest
from damageest.artefacts import Solid
from damageest.errors import DamageestError
from damageest.geometry.transforms import move_points
from damageest.isolation import cpu_seconds
from damageest.stages.scan.simulate import Simulate
from damageest_evaluate.parts import PARTS
from damageest_evaluate.scores import iou
from damageest_evaluate.sized import make_sized_damage

TOLERANCE = 0.2
"""In mm; the noise is a quarter of it."""
POINTS = 25_000


@dataclass(frozen=True)
class DeformedCase:
    """``part``: name of a built-in part; ``deform``: options of the virtual scanner's `deform`, amounts in tolerances;
    ``losses``: depth in mm of each random loss; ``wear``: tools that wear a face or a bore."""

    name: str
    part: str
    deform: Mapping[str, Any] = field(default_factory=dict)
    losses: Sequence[float] = ()
    wear: Sequence[Mapping[str, Any]] = ()
    seed: int = 1

    def simulate(self) -> tuple[Any, Any]:
        """Part and scan."""
        part = PARTS[self.part]()
        tools: list[Any] = list(self.wear)
        for number, depth in enumerate(self.losses):
            kind = ("chip", "pit", "cut")[(self.seed + number) % 3]
            tools += make_sized_damage(part, 100 * self.seed + number, depth, kind).tools
        amounts = ("bend", "twist", "scale", "stretch", "taper", "free")
        deform = {k: v * TOLERANCE if k in amounts else v for k, v in self.deform.items()}
        options: dict[str, Any] = {"points": POINTS, "noise": TOLERANCE / 4, "pose": "random", "seed": self.seed}
        scanner = Simulate.model_validate({**options, "damage": tools, "deform": deform or None})
        return part, scanner.run(part.unit, part)


def _wear_bore(radius: float, depth: float, shift: float = 0.0) -> list[dict[str, Any]]:
    """A rod that widens a bore along z by ``depth`` tolerances, and shifted by ``shift`` wears it to one side."""
    r, x = radius + depth * TOLERANCE, shift * TOLERANCE
    return [{"tool": "cylinder", "point": [x, 0, -200], "axis": [0, 0, 1], "radius": r, "length": 400}]


def _wear_top(height: float, depth: float) -> list[dict[str, Any]]:
    """Half of space above a plane ``depth`` tolerances below the top face at z = ``height``."""
    return [{"tool": "plane", "point": [0, 0, height - depth * TOLERANCE], "normal": [0, 0, 1]}]


DAMAGED = (
    DeformedCase("blade bent 3", "blade", {"bend": 3}, (3.0,)),
    DeformedCase("blade bent 10", "blade", {"bend": 10}, (3.0, 2.0), seed=2),
    DeformedCase("lever twisted 3", "lever", {"twist": 3}, (3.0,), seed=3),
    DeformedCase("lever twisted 8", "lever", {"twist": 8}, (2.0, 3.0), seed=4),
    DeformedCase("plate larger 3", "ribbed_plate", {"scale": 3}, (2.0,), seed=5),
    DeformedCase("plate bent 5", "ribbed_plate", {"bend": 5}, (2.0, 3.0), seed=6),
    DeformedCase("coupling tapered 3", "coupling", {"taper": 3}, (3.0,), seed=7),
    DeformedCase("coupling smaller 3", "coupling", {"scale": -3}, (3.0, 3.0), seed=8),
    DeformedCase("lever free 4", "lever", {"free": 4, "cells": 2, "seed": 1}, (3.0,), seed=9),
    DeformedCase("gear free 4", "gear", {"free": 4, "cells": 2, "seed": 2}, (2.0,), seed=10),
    DeformedCase("tube bent 5", "tube", {"bend": 5}, (3.0,), seed=11),
    DeformedCase("shaft bent 5", "keyed_shaft", {"bend": 5}, (2.0, 2.0), seed=12),
    DeformedCase("block stretched 3", "block", {"stretch": 3}, (4.0,), seed=13),
)
INTACT = (
    DeformedCase("intact blade bent 6", "blade", {"bend": 6}),
    DeformedCase("intact lever twisted 4", "lever", {"twist": 4}),
    DeformedCase("intact plate larger 3", "ribbed_plate", {"scale": 3}),
    DeformedCase("intact coupling tapered 3", "coupling", {"taper": 3}),
    DeformedCase("intact gear free 3", "gear", {"free": 3, "cells": 2, "seed": 3}),
    DeformedCase("intact tube straight", "tube"),
)
WORN = (
    DeformedCase("bore worn 2, straight", "gear", {}, wear=_wear_bore(10, 2)),
    DeformedCase("bore worn 2, bent 3", "gear", {"bend": 3}, wear=_wear_bore(10, 2)),
    DeformedCase("bore oval 3, straight", "coupling", {}, wear=_wear_bore(11, 1.5, 1.5)),
    DeformedCase("bore oval 3, twisted 3", "coupling", {"twist": 3}, wear=_wear_bore(11, 1.5, 1.5)),
    DeformedCase("face worn 2, straight", "block", {}, wear=_wear_top(15, 2)),
    DeformedCase("face worn 2, bent 5", "block", {"bend": 5}, wear=_wear_top(15, 2)),
    DeformedCase("lever bore worn 2, twisted 3", "lever", {"twist": 3}, wear=_wear_bore(8, 2)),
)
CASES = (*DAMAGED, *INTACT, *WORN)


def measure(case: DeformedCase, settings: Sequence[str]) -> dict[str, Any]:
    """The row of a case: the found volume against the true loss in the deformed part."""
    part, scan = case.simulate()
    before = cpu_seconds()
    job = {"version": 1, "units": "mm", "tolerance": TOLERANCE, "method": "auto"}
    try:
        result = damageest.run(job, part=part, scan=scan, settings=list(settings))
    except DamageestError as error:
        return {"case": case.name, "error": str(error)[:160]}
    seconds = cpu_seconds() - before
    D = result.pose.T_part_scan @ np.linalg.inv(scan.truth.T_part_scan)
    lost = scan.truth.deformed or scan.truth.damage
    truth = [Solid(move_points(lost.vertices, D), lost.faces)] if lost else []
    sites = [site for site in result.sites if site.accepted]
    true = truth[0].volume if truth else 0.0
    low, high = result.volume_95 or (0.0, float("inf"))
    adapted = result.adapted
    return {
        "case": case.name,
        "true": true,
        "found": sum(site.damage.volume for site in sites),
        "iou": iou([site.damage for site in sites], truth),
        "inside": bool(low <= true <= high),
        "interval": [low, high],
        "verdicts": [site.verdict.level for site in result.sites],
        "volumes": [round(site.damage.volume, 2) for site in result.sites],
        "adapt": [site.uncertainty.adapt if site.uncertainty else None for site in result.sites],
        "amount": adapted.amount if adapted else 0.0,
        "growth": adapted.growth if adapted else 0.0,
        "strain": adapted.strain if adapted else 0.0,
        "lattice": adapted.lattice if adapted else None,
        "gain": adapted.gain if adapted else 0.0,
        "seconds": seconds,
        "stage": sum(record.seconds for record in result.stages if record.stage == "adapt"),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--rows", default="")
    parser.add_argument("--use", nargs="*", default=["none", "smooth"])
    given = parser.parse_args()
    rows = []
    for case in CASES:
        if given.only not in case.name:
            continue
        for name in given.use:
            row = {"use": name, **measure(case, [f"adapt={name}", *given.settings])}
            rows.append(row)
            print(describe_row(row), flush=True)
    if given.rows:
        with open(given.rows, "w", encoding="utf-8") as stream:
            json.dump(rows, stream, indent=1)


def describe_row(row: Mapping[str, Any]) -> str:
    """A row of the table."""
    if "error" in row:
        return f"| {row['case']} | {row['use']} | {row['error']} |"
    low, high = row["interval"]
    marks = " ".join(level[0] for level in row["verdicts"])
    return (
        f"| {row['case']} | {row['use']} | {row['iou']:.3f} | {row['found']:.1f} of {row['true']:.1f} | "
        f"{low:.4g} to {high:.4g}{'' if row['inside'] else ' !'} | {marks or '-'} | {row['amount'] / TOLERANCE:.1f} | "
        f"{100 * row['strain']:.2f} % | {row['lattice'] or ''} | {row['seconds']:.0f} s, {row['stage']:.0f} |"
    )


if __name__ == "__main__":
    main()
