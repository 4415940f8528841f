"""The results of an evaluation as tables, as a line of text for each case, and as cases.csv and summary.json."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from damageest_evaluate.figures import (
    RIGHT,
    WRONG,
    Number,
    collect_axes,
    compute_figures,
    compute_stage_costs,
    format_label,
    group_by,
    group_by_combination,
    make_title,
    summarise,
)
from damageest_evaluate.processes import Row
from damageest_evaluate.tables import collect_versions, describe_measurement, format_markdown

COLUMNS: dict[str, tuple[str, str]] = {
    "cases": ("cases", "d"),
    "right": ("IoU >= 0.95", ".0%"),
    "iou": ("median IoU", ".3f"),
    "worst": ("lowest IoU", ".3f"),
    "volume_error": ("volume error", ".1%"),
    "surface_error": ("surface error", ".2f"),
    "distance_95": ("95 % distance", ".3g"),
    "distance_max": ("max. distance", ".3g"),
    "found": ("found", "d"),
    "missed": ("missed", "d"),
    "false_sites": ("false sites", "d"),
    "seconds": ("s", ".1f"),
    "libigl": ("x libigl", ".1f"),
    "megabytes": ("peak MB", ".0f"),
}
"""Name of a figure: its head in the table, and the format of the number."""


def make_legend(unit: str) -> str:
    """The explanation of the columns."""
    return (
        f"IoU >= {RIGHT}: share of the cases. volume error (absolute), surface error (in tolerances), s (seconds of a "
        f"run) and x libigl: medians. 95 % distance, max. distance: distance in {unit} between the found and the "
        "true inner damage surface where they are deeper than the tolerance; the median of its 95 % quantiles, and "
        "its maximum. found, missed: true damages; false sites: found sites without damage; all three "
        "are sums over the cases. x libigl: processor time of a run divided by that of one exact distance pass of "
        "libigl over the scan's points."
    )


def make_cells(rows: Sequence[Row], axis: str, unit: str) -> list[list[str]]:
    """Head and body of a table with a line for each value of ``axis``; if it is empty, with one line for all rows."""
    groups = group_by(rows, axis) if axis else {"all": rows}
    body = [[format_label(value), *_format_figures(compute_figures(group))] for value, group in groups.items()]
    return [[make_title(axis, rows, unit), *(head for head, _ in COLUMNS.values())], *body]


def make_combination_cells(rows: Sequence[Row], unit: str) -> list[list[str]]:
    """Head and body of a table with a line for each combination of varied values."""
    axes = list(collect_axes(rows))
    body = [
        [*map(format_label, values), *_format_figures(compute_figures(group))]
        for values, group in group_by_combination(rows).items()
    ]
    return [[*(make_title(axis, rows, unit) for axis in axes), *(head for head, _ in COLUMNS.values())], *body]


def _format_figures(values: dict[str, Number]) -> list[str]:
    return [_format_number(values[name], form) for name, (_, form) in COLUMNS.items()]


def _format_number(value: Number, form: str) -> str:
    return "–" if value is None else format(value, form)


def format_columns(lines: Sequence[Sequence[str]]) -> str:
    """A table as text, in columns of equal width."""
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return "\n".join(
        "  ".join(word.rjust(w) if k else word.ljust(w) for k, (word, w) in enumerate(zip(line, widths, strict=True)))
        for line in lines
    )


def format_tables(rows: Sequence[Row], axes: Sequence[str], unit: str) -> str:
    """The tables of all axes, the legend, the costs of the stages, and the remarks, as text."""
    tables = [format_columns(make_cells(rows, axis, unit)) for axis in axes or ("",)]
    if "way" in axes:  # figures over several ways together have no meaning
        tables = [format_columns(make_combination_cells(rows, unit))]
    return "\n\n".join([*tables, make_legend(unit), format_columns(make_stage_cells(rows)), make_remarks(rows)])


def make_stage_cells(rows: Sequence[Row]) -> list[list[str]]:
    """Head and body of the table with the cost of each stage."""
    body = [[name, f"{seconds:.2f}", f"{most:.0f}"] for name, (seconds, most) in compute_stage_costs(rows).items()]
    return [["stage", "s", "peak MB"], *body]


def make_remarks(rows: Sequence[Row]) -> str:
    """Wrong results, and how many of them were flagged; failed and skipped cases; the time to start."""
    figures = compute_figures(rows)
    skipped = [row for row in rows if row["skipped"]]
    lines = [
        f"cases with IoU < {WRONG}: {figures['wrong']}, of these flagged: {figures['wrong_flagged']}; "
        f"cases with IoU >= {RIGHT} but flagged: {figures['right_flagged']}; without a result: {figures['errors']}; "
        f"with a pose error above the tolerance: {figures['pose_lost']}"
    ]
    if figures["start_seconds"] is not None:
        lines.append(f"not included in s: {figures['start_seconds']:.1f} s to start Python and import the libraries")
    if skipped:
        lines.append(f"skipped cases: {len(skipped)}; the first: {skipped[0]['error']}")
    return "\n".join(lines)


def make_readme_tables(rows: Sequence[Row], axes: Sequence[str], unit: str, command: str) -> str:
    """The tables in Markdown, with the command, the date, the versions and the machine of the measurement.

    They come without the legend, which the page has once for all its tables.
    """
    tables = [
        format_markdown(
            [*make_cells(rows, axis, unit), *([["all", *_format_figures(compute_figures(rows))]] if not k else [])]
        )
        for k, axis in enumerate(axes)
    ]
    if "way" in axes:
        tables = [format_markdown(make_combination_cells(rows, unit), len(collect_axes(rows)))]
    text = "; ".join(make_remarks(rows).splitlines())
    return "\n\n".join([*tables, f"{text[:1].upper()}{text[1:]}.", describe_measurement(f"`{command}`")])


def format_row(row: Row) -> str:
    """The line that is printed when a case is finished."""
    what = " ".join([row["part"], str(row["seed"]), *(f"{k}={format_label(v)}" for k, v in row["varied"].items())])
    if row["skipped"]:
        return f"{what}: skipped: {row['error']}"
    text = f"{what}: {'+'.join(row['kinds']) or 'intact'}: IoU {row['iou']:.3f}, {row['seconds']:.1f} s"
    messages = [row["error"], *row["failures"], *row["reasons"]]
    return text + "".join(f"\n  {remark[:200]}" for remark in messages if remark)


def write_files(rows: Sequence[Row], unit: str, folder: Path, command: str) -> None:
    """Writes cases.csv and summary.json into ``folder``."""
    flat = [_flatten(row) for row in rows]
    names = list(dict.fromkeys(name for row in flat for name in row))
    with (folder / "cases.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, names, restval="")
        writer.writeheader()
        writer.writerows(flat)
    groups = {
        axis: [{"value": v, **compute_figures(g)} for v, g in group_by(rows, axis).items()]
        for axis in ("part", *collect_axes(rows))
    }
    summary = {"command": command, "unit": unit, **collect_versions(), "sentence": summarise(rows, unit)}
    costs = {
        name: {"seconds": seconds, "megabytes": most} for name, (seconds, most) in compute_stage_costs(rows).items()
    }
    summary |= {"all": compute_figures(rows), "by": groups, "stages": costs}
    (folder / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")


def _flatten(row: Row) -> dict[str, Any]:
    """A row without nested values: lists become text, and each entry of a mapping becomes a column."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, dict):
            flat |= {f"{name}.{key}": inner for key, inner in value.items()}
        else:
            flat[name] = "; ".join(map(str, value)) if isinstance(value, list) else value
    return flat
