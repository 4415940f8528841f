"""The evaluation as text and as files: tables, a line for each case, cases.csv, summary.json."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from damageest.evaluate._figures import (
    RIGHT,
    WRONG,
    Number,
    axes_of,
    by,
    crossed,
    figures,
    label,
    sentence,
    stages,
    title,
)
from damageest.evaluate._run import Row
from damageest.evaluate._table import about, markdown, versions

COLUMNS: dict[str, tuple[str, str]] = {
    "cases": ("cases", "d"),
    "right": ("right", ".0%"),
    "iou": ("IoU", ".3f"),
    "worst": ("worst", ".3f"),
    "volume_error": ("volume error", ".1%"),
    "surface_error": ("surface error", ".2f"),
    "distance_95": ("95 % within", ".3g"),
    "distance_max": ("all within", ".3g"),
    "found": ("found", "d"),
    "missed": ("missed", "d"),
    "invented": ("invented", "d"),
    "seconds": ("s", ".1f"),
    "libigl": ("x libigl", ".1f"),
    "megabytes": ("peak MB", ".0f"),
}
"""Name among the figures to the table's head and the form of the number."""


def legend(unit: str) -> str:
    """What the columns say."""
    return (
        f"right: IoU >= {RIGHT}. IoU, volume error (either sign), surface error (in tolerances) and seconds: medians. "
        f"95 % within, all within: how far apart, in {unit}, found and true inner damage surface lie where they are "
        "deeper than the tolerance, median and largest over the cases. found, missed, invented: losses and sites over "
        "all cases. x libigl: processor time over that of one exact distance pass of libigl over the scan's points."
    )


def cells(rows: Sequence[Row], axis: str, unit: str) -> list[list[str]]:
    """Head and body of a table with a line for each value of an axis; an empty one: a single line for all."""
    groups = by(rows, axis) if axis else {"all": rows}
    body = [[label(value), *_numbers(figures(group))] for value, group in groups.items()]
    return [[title(axis, rows, unit), *(head for head, _ in COLUMNS.values())], *body]


def cross_cells(rows: Sequence[Row], unit: str) -> list[list[str]]:
    """Head and body of a table with a line for each combination of what was varied."""
    axes = list(axes_of(rows))
    body = [[*map(label, values), *_numbers(figures(group))] for values, group in crossed(rows).items()]
    return [[*(title(axis, rows, unit) for axis in axes), *(head for head, _ in COLUMNS.values())], *body]


def _numbers(found: dict[str, Number]) -> list[str]:
    return [_number(found[name], form) for name, (_, form) in COLUMNS.items()]


def _number(value: Number, form: str) -> str:
    return "–" if value is None else format(value, form)


def plain(lines: Sequence[Sequence[str]]) -> str:
    """A table in columns."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return "\n".join(
        "  ".join(word.rjust(w) if k else word.ljust(w) for k, (word, w) in enumerate(zip(line, widths, strict=True)))
        for line in lines
    )


def tables(rows: Sequence[Row], axes: Sequence[str], unit: str) -> str:
    """One for each axis, and what does not go into tables."""
    made = [plain(cells(rows, axis, unit)) for axis in axes or ("",)]
    if "way" in axes:  # a mean over ways to compare says nothing
        made = [plain(cross_cells(rows, unit))]
    return "\n\n".join([*made, legend(unit), plain(stage_cells(rows)), remarks(rows)])


def stage_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body of the table of what each stage costs."""
    body = [[name, f"{seconds:.2f}", f"{most:.0f}"] for name, (seconds, most) in stages(rows).items()]
    return [["stage", "s", "peak MB"], *body]


def remarks(rows: Sequence[Row]) -> str:
    """How far the results owned up to being wrong, and what went wrong."""
    found = figures(rows)
    skipped = [row for row in rows if row["skipped"]]
    lines = [
        f"wrong (IoU < {WRONG}): {found['wrong']}, flagged {found['wrong_flagged']} of them; right but flagged: "
        f"{found['right_flagged']}; without a result: {found['errors']}; pose off by more than the tolerance: "
        f"{found['pose_lost']}"
    ]
    if found["start_seconds"] is not None:
        lines.append(f"beside it, to start Python and import the libraries: {found['start_seconds']:.1f} s")
    if skipped:
        lines.append(f"left out: {len(skipped)}, as {skipped[0]['error']}")
    return "\n".join(lines)


def readme_table(rows: Sequence[Row], axes: Sequence[str], unit: str, command: str) -> str:
    """The tables for a README, with what was measured, when and on what."""
    made = [
        markdown([*cells(rows, axis, unit), *([["all", *_numbers(figures(rows))]] if not k else [])])
        for k, axis in enumerate(axes)
    ]
    if "way" in axes:
        made = [markdown(cross_cells(rows, unit), len(axes_of(rows)))]
    said = f"{legend(unit)} {'; '.join(remarks(rows).splitlines())}."
    return "\n\n".join([*made, said, about(f"`{command}`")])


def line(row: Row) -> str:
    """What is told of a case when it is done."""
    what = " ".join([row["part"], str(row["seed"]), *(f"{k}={label(v)}" for k, v in row["varied"].items())])
    if row["skipped"]:
        return f"{what}: left out: {row['error']}"
    text = f"{what}: {'+'.join(row['kinds']) or 'sound'}: IoU {row['iou']:.3f}, {row['seconds']:.1f} s"
    said = [row["error"], *row["failures"], *row["reasons"]]
    return text + "".join(f"\n  {remark[:200]}" for remark in said if remark)


def write_files(rows: Sequence[Row], unit: str, folder: Path, command: str) -> None:
    """cases.csv and summary.json; cases.jsonl is there already."""
    flat = [_flat(row) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    with (folder / "cases.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, names, restval="")
        writer.writeheader()
        writer.writerows(flat)
    groups = {
        axis: [{"value": v, **figures(g)} for v, g in by(rows, axis).items()] for axis in ("part", *axes_of(rows))
    }
    summary = {"command": command, "unit": unit, **versions(), "sentence": sentence(rows, unit)}
    costs = {name: {"seconds": seconds, "megabytes": most} for name, (seconds, most) in stages(rows).items()}
    summary |= {"all": figures(rows), "by": groups, "stages": costs}
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")


def _flat(row: Row) -> dict[str, Any]:
    """A row without nesting: lists as text, mappings as columns of their own."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": inner for key, inner in value.items()}
        else:
            flat[name] = "; ".join(map(str, value)) if isinstance(value, list) else value
    return flat
