"""What other parts of a type are worth: the error at a lost end, with and without their forms.

``python -m damageest_benchmarks.adapting.prior --part blade --kind common --others 12 --targets 4``
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from damageest_evaluate.tables import format_markdown

from damageest.artefacts import AdaptedPart, Part, Scan
from damageest.geometry.transforms import move_points
from damageest.io.forms import MeasuredForm, identify_part, mark_scan, write_form
from damageest.registry import Registry
from damageest.stages.scan.deformation import Deformation, deform
from damageest.stages.scan.simulate import Simulate
from damageest_benchmarks.adapting.case import TOLERANCE
from damageest_benchmarks.adapting.suite import cut_end
from damageest_benchmarks.parts import PARTS

WIDTH = 1.96
LOST = 0.1
"""Share of the length that is lost."""
KINDS = ("bent", "common", "other", "tips lost")
"""``bent``: bent and twisted, by amounts that differ; ``common``: with a smooth form that all have as well; ``other``:
as common, but the part in question has another form; ``tips lost``: as common, and all others lost the same end."""


def draw_deformation(kind: str, rng: np.random.Generator, is_target: bool) -> dict[str, float]:
    """Options of the virtual scanner's `deform` for one part of the type."""
    amounts = {"bend": 5 + 1.5 * rng.normal(), "twist": 3 + rng.normal()}
    if kind != "bent":
        amounts["free"] = max(3 + 0.3 * rng.normal(), 0.0)
    how = {name: float(amount * TOLERANCE) for name, amount in amounts.items()}
    if kind != "bent":
        how |= {"cells": 1, "seed": 9 if kind == "other" and is_target else 5}
    return how


def scan(part: Part, how: dict[str, float], seed: int, tools: Sequence[Any], points: int) -> Scan:
    """A virtual scan in the part's frame."""
    options = {"points": points, "noise": TOLERANCE / 4, "seed": seed, "deform": how, "damage": list(tools)}
    found = Simulate.model_validate(options).run(part.unit, part)
    return replace(found, noise=TOLERANCE / 4, spacing=float(np.sqrt(part.area / points)))


def adapt(part: Part, given: Scan, files: Sequence[Path]) -> AdaptedPart | None:
    """What the stage gives for a scan whose pose is known."""
    options = {"points": 5000, "lattice": [], "prior": [str(path) for path in files]}
    stage: Any = Registry.discover().get("adapt", "smooth").cls.model_validate(options)
    found: AdaptedPart | None = stage.run(part, given, TOLERANCE)
    return found


def keep(path: Path, part: Part, given: Scan, adapted: AdaptedPart) -> None:
    """Writes the form of a part, as a run does."""
    assert adapted.field is not None
    assert adapted.seen is not None
    assert adapted.left is not None
    seen, names = (adapted.seen, adapted.left, adapted.reach), identify_part(part)
    write_form(path, MeasuredForm(adapted.field, *seen, part.unit, TOLERANCE, names, marks=mark_scan(given)))


def measure_end(part: Part, adapted: AdaptedPart, how: dict[str, float]) -> dict[str, float]:
    """Error and interval of the skin at the lost end, along its normals, in tolerances."""
    before = adapted.part.vertices - adapted.displacement
    true = move_points(deform(before, Deformation.model_validate(how), part), adapted.motion)
    normals = adapted.part.vertex_normals
    off = np.abs(np.einsum("ij,ij->i", adapted.part.vertices - true, normals))
    half = WIDTH * np.sqrt((np.einsum("kvc,vc->kv", adapted.modes, normals) ** 2).sum(axis=0))
    low, high = part.bounds
    axis = int((high - low).argmax())
    end = before[:, axis] > high[axis] - LOST * (high - low)[axis]
    return {
        "error": float(off[end].mean()) / TOLERANCE,
        "largest": float(off[end].max()) / TOLERANCE,
        "half": float(half[end].mean()) / TOLERANCE,
        "inside": float((off <= half)[end].mean()),
        "seen": float(off[~end].mean()) / TOLERANCE,
    }


def measure(
    name: str, kind: str, others: int, targets: int, counts: Sequence[int], points: int, seed: int, folder: Path
) -> list[dict[str, Any]]:
    """Rows of all targets, one for each number of other parts; each part is scanned and adapted on its own."""
    part, rng, rows = PARTS[name](), np.random.default_rng(seed), []
    tip = [cut_end(name, LOST)]
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"{number}.npz" for number in range(others)]
    for number, path in enumerate(files):
        how = draw_deformation("common" if kind == "other" else kind, rng, False)
        if path.is_file():
            continue
        given = scan(part, how, 1000 * seed + number, tip if kind == "tips lost" else [], points)
        if (adapted := adapt(part, given, [])) is not None:
            keep(path, part, given, adapted)
    files = [path for path in files if path.is_file()]
    for target in range(targets):
        how = draw_deformation(kind, rng, True)
        given = scan(part, how, 1000 * seed + 500 + target, tip, points)
        for count in counts:
            adapted = adapt(part, given, files[:count])
            row: dict[str, Any] = {"part": name, "kind": kind, "target": target, "others": count, "adapted": False}
            if adapted is not None:
                used = adapted.prior.is_used if adapted.prior else None
                row |= {"adapted": True, "used": used, **measure_end(part, adapted, how)}
            rows.append(row)
            print(json.dumps(row), flush=True)
    return rows


def make_prior_table(rows: Sequence[dict[str, Any]]) -> str:
    """A table in Markdown: for each part, kind and number of others, medians over the targets."""
    head = ["part", "kind", "others", "targets", "used", "error", "largest", "half width", "inside"]
    lines = []
    groups = dict.fromkeys((row["part"], row["kind"], row["others"]) for row in rows)
    for group in groups:
        chosen = [row for row in rows if (row["part"], row["kind"], row["others"]) == group and row["adapted"]]
        if chosen:
            medians = [f"{np.median([row[key] for row in chosen]):.2f}" for key in ("error", "largest", "half")]
            inside = f"{100 * np.mean([row['inside'] for row in chosen]):.0f} %"
            used = sum(bool(row["used"]) for row in chosen)
            lines.append([*map(str, group), str(len(chosen)), str(used), *medians, inside])
    return format_markdown([head, *lines], names=2)


def main() -> None:
    """Measures as the arguments say, and prints rows and table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", default="blade", choices=sorted(PARTS))
    parser.add_argument("--kind", default="common", choices=KINDS)
    parser.add_argument("--others", type=int, default=12)
    parser.add_argument("--targets", type=int, default=4)
    parser.add_argument("--counts", default="0,1,3,12")
    parser.add_argument("--points", type=int, default=12_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--forms", type=Path, help="folder that keeps the forms of the others; those there are taken")
    asked = parser.parse_args()
    counts = [int(text) for text in asked.counts.split(",")]
    with TemporaryDirectory(prefix="damageest-prior-") as scratch:
        folder = asked.forms or Path(scratch)
        rows = measure(asked.part, asked.kind, asked.others, asked.targets, counts, asked.points, asked.seed, folder)
    print(make_prior_table(rows))


if __name__ == "__main__":
    main()
